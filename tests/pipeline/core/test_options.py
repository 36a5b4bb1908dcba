"""Options of one dataclass: the keyword arguments for a parser, and the bounds."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from advpipe.pipeline.campaigns.sweep.options import SweepOptions
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.options import check_bounds, option, parser_options
from advpipe.stages.evaluate.options import Options


@dataclass(frozen=True)
class Rounds:
    rounds: int = option(3, "How often.", least=1)
    most_tries: int | None = option(None, "At most.", least=2)
    name: str = option("a", "Whose.")

    def __post_init__(self) -> None:
        check_bounds(self)


def test_options_have_help_bounds_and_defaults() -> None:
    assert parser_options(Rounds, "rounds") == {"help": "How often.", "min": 1}
    assert parser_options(Rounds, "name") == {"help": "Whose."}
    assert Rounds.rounds == Rounds().rounds == 3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rounds": 0}, "rounds are 0, but must be 1 or more"),
        ({"most_tries": 1}, "most tries are 1, but must be 2 or more"),
    ],
)
def test_bounds_are_checked(given: dict[str, int], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        Rounds(**given)


@pytest.mark.parametrize("model", [Options, SweepOptions])
def test_bounds_apply_without_the_command_line(model: type) -> None:
    with pytest.raises(UsageError, match="seed is -1, but must be 0 or more"):
        model(seed=-1)
