"""All mistakes of one attack, where others stop at the first."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.declared import declaration_of
from advpipe.stages.attack.registry import (
    default_budget,
    find_attack,
    refuse_foreign_keys,
    resolved_name,
)


def mistakes_of_spec(spec: AttackSpec) -> Iterator[str]:
    """What is wrong with an attack for any bag: its name, keys of other families, its parameters, its recipe.

    A parameter that a mistake names is left out, and a missing budget set, when what follows is looked at.
    """
    try:
        left = resolved_name(spec)
        find_attack(left.type)
    except AdvpipeError as error:
        yield str(error)
        return
    try:
        refuse_foreign_keys(left)
    except AdvpipeError as error:
        yield str(error)
    found: list[str] = []
    while message := _first_mistake(left):
        missing = re.search(r"(\w+) is missing; pass ", message)
        if missing is None:
            found.append(message)
            yield message
        elif missing[1] not in spec.parameters and not any(f"mean {missing[1]!r}" in one for one in found):
            yield f"{left.type}: {missing[1]} is missing; add it to `parameters`"
        fewer = _with_budget(left, missing[1]) if missing else _without_named(left, message)
        if fewer is None:
            return
        left = fewer


def _first_mistake(spec: AttackSpec) -> str:
    try:
        declaration_of(spec)
    except AdvpipeError as error:
        return str(error)
    return ""


def _with_budget(spec: AttackSpec, missing: str) -> AttackSpec | None:
    """The attack with a missing budget at its usual value."""
    usual = default_budget(spec.type)
    if missing not in usual:
        return None
    return spec.model_copy(update={"parameters": {**spec.parameters, missing: usual[missing]}})


def _without_named(spec: AttackSpec, message: str) -> AttackSpec | None:
    """The attack without the first parameter that the message names, or without its recipe."""
    found = {name: re.search(rf"\b{re.escape(name)}\b", message) for name in spec.parameters}
    begins = {name: match.start() for name, match in found.items() if match}
    update: dict[str, Any]
    if begins:
        named = min(begins, key=lambda name: begins[name])
        update = {"parameters": {key: value for key, value in spec.parameters.items() if key != named}}
    elif spec.recipe is not None:
        update = {"recipe": None}
    else:
        return None
    return spec.model_copy(update=update)
