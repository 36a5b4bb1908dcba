"""Mistakes in a scenario's attacks that its schema cannot know, found together with those of the schema."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from pydantic import ValidationError

from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.scenario.mistake import Mistake
from advpipe.pipeline.scenario.models import Scenario

AttackCheck = Callable[[Sequence[AttackSpec], Scenario | None], Iterable[tuple[int | None, str]]]
"""Yields the mistakes of the attacks on one bag: the number of the attack, None for all of them, and what is
wrong. Its second argument is None where the scenario has mistakes of its schema."""


def attack_mistakes(tree: dict[str, Any], scenario: Scenario | None, check: AttackCheck) -> Iterator[Mistake]:
    """The mistakes that a check finds in the attacks of a scenario's tree.

    Keys that the schema refuses, which is reported elsewhere, are left out; an attack is not checked if what
    remains is none.
    """
    bags = tree.get("attacks")
    for name, given in bags.items() if isinstance(bags, dict) else ():
        items = given if isinstance(given, list) else [given]
        specs = {number: spec for number, item in enumerate(items) if (spec := _readable(item)) is not None}
        numbers = list(specs)
        for index, message in check(tuple(specs.values()), scenario):
            yield ("attacks", str(name), *(() if index is None else (str(numbers[index]),))), message


def _readable(item: Any) -> AttackSpec | None:
    """The attack without the keys that its schema refuses."""
    try:
        return AttackSpec.model_validate(item)
    except ValidationError as error:
        wrong = {each["loc"][0] for each in error.errors() if each["loc"]}
    if not isinstance(item, dict) or not wrong or wrong & {"type", "parameters"}:
        return None
    try:
        return AttackSpec.model_validate({key: value for key, value in item.items() if key not in wrong})
    except ValidationError:
        return None
