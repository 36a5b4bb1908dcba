"""Who lies by V2X: what the words for it become."""

from __future__ import annotations

import pytest

from advpipe import UsageError
from advpipe.commands.attackers import attackers_section


def test_attackers() -> None:
    assert attackers_section([]) is None
    assert attackers_section(["a", "b"]) == {"vehicles": ["a", "b"]}
    assert attackers_section(["25%"]) == {"share": 0.25}
    assert attackers_section(["rsu:3,-4.5"]) == {"roadside_unit": {"x_m": 3.0, "y_m": -4.5}}
    assert attackers_section(["rsu:3,-4.5,6"]) == {"roadside_unit": {"x_m": 3.0, "y_m": -4.5, "z_m": 6.0}}


@pytest.mark.parametrize("attackers", [["a", "20%"], ["some%"], ["rsu:"], ["rsu:1,b"], ["rsu:1,2,3,4"]])
def test_others_are_refused(attackers: list[str]) -> None:
    with pytest.raises(UsageError, match=r"^attacker="):
        attackers_section(attackers)
