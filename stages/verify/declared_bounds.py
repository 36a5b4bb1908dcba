"""Bounds that a bag declares, some perhaps on quantities that this version does not know."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from advpipe.pipeline.labels.quantity import Quantity, Range
from advpipe.stages.verify.attackers import MessageAttack
from advpipe.stages.verify.result import NOT_DECLARED, Unchecked


def measurable(bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[Any]]) -> dict[str, Range]:
    """The bounds on quantities that this version measures."""
    return {name: bound for name, bound in bounds.items() if name in quantities}


def unmeasurable(
    place: str, attack: str, bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[Any]]
) -> Iterator[Unchecked]:
    """A result for each bound on any other quantity."""
    for name in sorted(bounds.keys() - quantities.keys()):
        yield Unchecked(place, f"{name} of {attack} not checked: unknown quantity in this version")


def undeclared(
    place: str, attacks: Iterable[MessageAttack], quantities: Mapping[str, Quantity[Any]]
) -> Iterator[Unchecked]:
    """A result for each attack without a declaration, and for each bound that cannot be measured."""
    for each in attacks:
        if each.declared is None:
            yield Unchecked(place, f"bounds of {each.spec.type} {NOT_DECLARED}")
        else:
            yield from unmeasurable(place, each.spec.type, each.declared.bounds, quantities)
