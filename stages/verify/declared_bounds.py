"""Bounds that a bag declares, some perhaps on quantities that this version does not know."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from advpipe.pipeline.labels.quantity import Quantity, Range
from advpipe.stages.verify.result import Unchecked


def measurable(bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[Any]]) -> dict[str, Range]:
    """The bounds on quantities that this version measures."""
    return {name: bound for name, bound in bounds.items() if name in quantities}


def unmeasurable(
    place: str, attack: str, bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[Any]]
) -> Iterator[Unchecked]:
    """A result for each bound on any other quantity."""
    for name in sorted(bounds.keys() - quantities.keys()):
        yield Unchecked(place, f"{name} of {attack} not checked: unknown quantity in this version")
