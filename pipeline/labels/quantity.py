"""A number that can be measured of what an attack changed: attacks bound it, and `verify` measures it again.

Quantities of clouds, fixes and messages: `quantities`, `fix_quantities` and `message_quantities`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

ROUNDING = 1e-6
"""A quantity may exceed its bound by this much and this share of it: machines sum in different orders."""

C = TypeVar("C")

Range = tuple[float, float]
"""Minimum and maximum of a quantity."""


@dataclass(frozen=True)
class Quantity(Generic[C]):
    """A number that can be measured of any change of one family.

    unit: "1" for counts and shares. measure: returns None where a change has no such number. resolution: how
    far it may differ from the attack's own number, since messages quantise it.
    """

    name: str
    unit: str
    meaning: str
    measure: Callable[[C], float | None]
    resolution: float = 0.0

    def excess(self, change: C, least: float, most: float) -> str:
        """A sentence on how a change exceeds these bounds; "" if it keeps them."""
        value = self.measure(change)
        if value is None or least <= value <= most:
            return ""
        if least - self._slack(least) <= value <= most + self._slack(most):
            return ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        bounds = f"{least:g} to {most:g}" if least < most else f"{most:g}"
        return f"{self.meaning}: {value:.8g}{unit}, but the attack declares {bounds}{unit} ({self.name})"

    def _slack(self, bound: float) -> float:
        return self.resolution + ROUNDING * (1 + abs(bound))


def excesses(change: C, bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[C]]) -> Iterator[str]:
    """A sentence for each declared bound that a change exceeds. Raises KeyError for an unknown quantity."""
    for name, (least, most) in bounds.items():
        if found := quantities[name].excess(change, least, most):
            yield found


def beyond_all(
    change: C, candidates: Sequence[Mapping[str, Range]], quantities: Mapping[str, Quantity[C]]
) -> str:
    """A sentence on how a change exceeds the bounds of every attack that could have made it; "" if it keeps
    those of one attack, or if no such attack is known."""
    found = [next(excesses(change, bounds, quantities), "") for bounds in candidates]
    return found[0] if all(found) and found else ""
