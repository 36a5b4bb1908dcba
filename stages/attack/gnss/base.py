"""What a GPS attack is: from the fixes that a receiver would have had, the fixes that it is made to have."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.fix_quantities import FIX_QUANTITIES
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.stages.attack.base import Attack, Traits


class TrueFix(NamedTuple):
    """A fix as the satellites alone would have given it: position_m (3,) in the map."""

    stamp_ns: int
    position_m: Float64


@dataclass(frozen=True)
class SpoofingContext:
    """One fix at the moment of the attack, and what a spoofer may know of its victim.

    true_fixes: all fixes until now, attacked or not, as they would have been; the last one is this fix.
    elapsed_s: since the first attacked fix of this span, interval_s: since the attacked fix before; both 0 at
    a span's first. heading_rad: of the victim, about the map's vertical from its x axis, as it knows it.
    innovation: what the victim's filter would make of the genuine fix, with all that it has been told so
    far; only a spoofer who knows the filter and its sensors can ask for it.
    """

    true_fixes: Sequence[TrueFix]
    elapsed_s: float
    interval_s: float
    heading_rad: float
    innovation: Callable[[], Innovation]

    @property
    def position_m(self) -> Float64:
        """The genuine fix (3,) in the map."""
        return self.true_fixes[-1].position_m

    @property
    def is_first(self) -> bool:
        """Whether a span of attacked fixes begins: a lie that grows starts anew."""
        return self.elapsed_s == 0


Spoofer = Callable[[SpoofingContext], Float64 | None]
"""Gives the false fix (3,) in the map, None for no fix at all; called for each attacked fix in order."""


@dataclass(frozen=True, kw_only=True)
class GnssTraits(Traits):
    """What is known of a GPS attack whatever its parameters.

    needs_filter: it asks for `SpoofingContext.innovation`, so that a station of which the bag holds CAMs
    alone cannot be its victim.
    """

    needs_filter: bool = False


class GnssAttack(Attack):
    """A GPS attack with its parameters, which its constructor takes keyword-only, with defaults and units in
    their names, and checks. It declares its `traits`:

    >>> class North(GnssAttack):
    ...     traits = GnssTraits()
    ...
    ...     def __init__(self, *, offset_m: float = 10.0) -> None:
    ...         self.offset_m = offset_m
    ...
    ...     def begin(self, rng):
    ...         return lambda context: context.position_m + [0.0, self.offset_m, 0.0]

    What it keeps to in numbers are its `bounds`: a fix beyond them is refused, and `verify` measures them
    again. Several on one vehicle cannot act at the same time: a receiver reports one place.
    """

    family = "gnss"
    traits_type = GnssTraits
    quantities = FIX_QUANTITIES

    @property
    @abstractmethod
    def traits(self) -> GnssTraits: ...

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Least and most of each quantity that the attack bounds, with its parameters, in every fix while it
        is on; by names of `advpipe.pipeline.labels.fix_quantities`. Nothing where it bounds none."""
        return {}

    @abstractmethod
    def begin(self, rng: np.random.Generator) -> Spoofer:
        """The attack on one victim; all its draws come from `rng`."""


def gnss_traits(kind: type[GnssAttack]) -> GnssTraits:
    """The traits of a class."""
    found: GnssTraits = vars(kind)["traits"]
    return found


def horizontal_unit(angle_rad: float) -> Float64:
    """The horizontal unit vector (3,) at an angle from the map's x axis."""
    return np.array([math.cos(angle_rad), math.sin(angle_rad), 0.0])


def random_direction(rng: np.random.Generator) -> Float64:
    """A horizontal unit vector (3,), uniform in all directions."""
    return horizontal_unit(float(rng.uniform(0, math.tau)))
