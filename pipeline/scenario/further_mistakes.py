"""Mistakes between the sections of a scenario whose keys have mistakes of their own."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from advpipe.pipeline.scenario.mistake import Mistake, SeveralMistakesError
from advpipe.pipeline.scenario.models import Scenario

DECISIVE = (
    ("bodies",),
    ("vehicles",),
    ("trajectories",),
    ("simulation", "duration_s"),
    ("simulation", "step_s"),
)
"""Sections and keys that others refer to: while these are wrong, what does not fit to them may be right."""

_STAND_INS: dict[str, Any] = {"name": "scenario", "map": {"generator": {}}}
"""For required keys that are wrong or missing."""

_MOST_ROUNDS = 4


def further_mistakes(tree: dict[str, Any], error: ValidationError, found: Sequence[Mistake]) -> list[Mistake]:
    """What does not fit together in a scenario whose keys with mistakes are left out.

    error: of the scenario as it is, and found: the mistakes that it names; they are not given again.
    """
    left: dict[str, Any] = copy.deepcopy(tree)
    for _ in range(_MOST_ROUNDS):
        places = [tuple(part for part in each["loc"] if part != "[key]") for each in error.errors()]
        if not all(places) or any(_is_decisive(place) for place in places):
            break
        for place in places:
            _leave_out(left, place)
        try:
            Scenario.model_validate(left)
        except ValidationError as next_error:
            error = next_error
        else:
            return []
    several = [each.get("ctx", {}).get("error") for each in error.errors()]
    mistakes = [one for each in several if isinstance(each, SeveralMistakesError) for one in each.found]
    return [one for one in mistakes if one not in found]


def _is_decisive(place: Sequence[int | str]) -> bool:
    return any(tuple(place[: len(keys)]) == keys for keys in DECISIVE)


def _leave_out(tree: dict[str, Any], place: tuple[int | str, ...]) -> None:
    """Takes the key away, or the section in which it is missing; a required section gets a stand-in."""
    node: Any = tree
    for number, part in enumerate(place[:-1]):
        inner = node.get(part) if isinstance(node, dict) else None
        is_missing = number == len(place) - 2 and isinstance(inner, dict) and place[-1] not in inner
        if is_missing or not isinstance(inner, dict):
            place = place[: number + 1]
            break
        node = inner
    if isinstance(node, dict):
        node.pop(place[-1], None)
    if place[0] not in tree and place[0] in _STAND_INS:
        tree[str(place[0])] = copy.deepcopy(_STAND_INS[str(place[0])])
