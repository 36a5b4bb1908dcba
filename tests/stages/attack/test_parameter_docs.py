"""Parameters as users read of them, from the docstrings of classes."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.parameter_docs import documented_parameters, summary
from advpipe.stages.attack.parameters import REQUIRED


class Shared:
    """Of several attacks.

    side: left or right: one of them.
    other: not of these attacks.
    """


@dataclass(frozen=True, kw_only=True)
class Parent(GnssAttack):
    """Slides away,
    slowly.

    rate_mps: how fast; most_m,
    least_m: at most and
        at least. A word
        in a line: of no parameter. side: see `Shared`.

    Another paragraph.
    """

    traits = GnssTraits()
    rate_mps: float
    most_m: float | None = None
    least_m: int = 0
    side: str = "left"
    untold: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Child(Parent):
    traits = GnssTraits()
    rate_mps: float = 2.0


def test_worked_out_by_hand() -> None:
    documented = [(one.name, one.types, one.default, one.help) for one in documented_parameters(Parent)]
    both = "at most and at least. A word in a line: of no parameter."
    assert documented == [
        ("rate_mps", (float,), REQUIRED, "how fast"),
        ("most_m", (float,), None, both),
        ("least_m", (int,), 0, both),
        ("side", (str,), "left", "left or right: one of them."),
        ("untold", (str,), (), ""),
    ]
    assert summary(Parent) == "Slides away, slowly."


def test_a_class_without_a_docstring_takes_its_parents() -> None:
    assert [one.help for one in documented_parameters(Child)] == [
        one.help for one in documented_parameters(Parent)
    ]
    assert summary(Child) == ""


@pytest.mark.parametrize("name", LIDAR_ATTACKS)
def test_all_parameters_of_attacks_on_clouds_are_explained(name: str) -> None:
    assert [one.name for one in documented_parameters(LIDAR_ATTACKS[name]) if not one.help] == []
