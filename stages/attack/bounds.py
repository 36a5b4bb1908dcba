"""Checks of parameters as the command line or a scenario gives them."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr


def checked_number(attack: str, parameter: str, value: Any, low: float, high: float = math.inf) -> float:
    """The value. Raises AdvpipeError, with the names of attack and parameter, if it is not a finite number in
    [low, high]."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not is_within(value, low, high):
        limits = f"at least {low:g}" if high == math.inf else f"{low:g} to {high:g}"
        raise UsageError(f"{attack}: {parameter} is {short_repr(value)}; it takes a number, {limits}")
    return value


def is_within(value: float, low: float, high: float) -> bool:
    """Whether a value is finite and in [low, high]."""
    return math.isfinite(value) and low <= value <= high


def checked_integer(attack: str, parameter: str, value: Any, low: int, high: int) -> int:
    """`checked_number` for whole numbers."""
    if int(checked_number(attack, parameter, value, low, high)) != value:
        raise UsageError(f"{attack}: {parameter} is {short_repr(value)}; it takes a whole number")
    return int(value)


def checked_range(
    attack: str, parameter: str, low: Any, high: Any, least: float, most: float
) -> tuple[float, float]:
    """Both ends of a range to draw from, in order; `{}` in the parameter's name stands for min and max."""
    names = parameter.format("min"), parameter.format("max")
    ends = (
        checked_number(attack, names[0], low, least, most),
        checked_number(attack, names[1], high, least, most),
    )
    if ends[0] > ends[1]:
        raise UsageError(f"{attack}: {names[0]}, {low:g}, is above {names[1]}, {high:g}")
    return ends


def checked_choice(attack: str, parameter: str, value: Any, known: Collection[str]) -> str:
    """The value, one of the known ones. Raises AdvpipeError for any other."""
    if value not in known:
        raise UsageError(f"{attack}: {parameter} is {short_repr(value)}; {known_names(value, known)}")
    return str(value)
