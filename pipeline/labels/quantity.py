"""A number that can be measured of what an attack changed: attacks bound it, and `verify` measures it again.

Those of clouds, fixes and messages: `quantities`, `fix_quantities` and `message_quantities`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

ROUNDING = 1e-6
"""Beyond its bound, a quantity may be this much, and this share of it: machines add up in other orders."""

C = TypeVar("C")

Range = tuple[float, float]
"""Least and most of a quantity."""


@dataclass(frozen=True)
class Quantity(Generic[C]):
    """A number that can be measured of any change of one family.

    unit: "1" of counts and shares. measure: None where a change has no such number. resolution: how far from
    the attack's own number it may come out, as a message tells it in steps.
    """

    name: str
    unit: str
    meaning: str
    measure: Callable[[C], float | None]
    resolution: float = 0.0

    def excess(self, change: C, least: float, most: float) -> str:
        """How a change is beyond its bounds, in words; "" where it keeps to them."""
        value = self.measure(change)
        if value is None or least - self._slack(least) <= value <= most + self._slack(most):
            return ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        bounds = f"{least:g} to {most:g}" if least < most else f"{most:g}"
        return f"{self.meaning}: {value:.8g}{unit}, but the attack declares {bounds}{unit} ({self.name})"

    def _slack(self, bound: float) -> float:
        return self.resolution + ROUNDING * (1 + abs(bound))


def excesses(change: C, bounds: Mapping[str, Range], quantities: Mapping[str, Quantity[C]]) -> Iterator[str]:
    """How a change is beyond the bounds that were declared, one line each. Raises KeyError for a quantity
    that is none."""
    for name, (least, most) in bounds.items():
        if found := quantities[name].excess(change, least, most):
            yield found


def beyond_all(
    change: C, candidates: Sequence[Mapping[str, Range]], quantities: Mapping[str, Quantity[C]]
) -> str:
    """How a change is beyond the bounds of every attack that could have made it; "" where it keeps to those
    of one, or nobody is known who could."""
    found = [next(excesses(change, bounds, quantities), "") for bounds in candidates]
    return found[0] if all(found) and found else ""
