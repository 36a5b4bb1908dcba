"""The base of GPS attacks: they replace the true fixes of a receiver by false ones."""

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
    """A fix from the genuine satellite signals: position_m (3,) in the map."""

    stamp_ns: int
    position_m: Float64


@dataclass(frozen=True)
class SpoofingContext:
    """One fix under attack, and what a spoofer may know about its victim.

    true_fixes: all true fixes until now, attacked or not; the last one is this fix.
    elapsed_s: since the first attacked fix of this span, interval_s: since the previous attacked fix; both 0
    at the first fix of a span. heading_rad: the victim's estimated heading, about the map's vertical from its
    x axis. innovation: computes the innovation of the true fix in the victim's filter, given all earlier
    reported fixes; only a spoofer that knows the filter and its sensors can use it. past_nis: the normalised
    innovations squared of all earlier reported fixes in that filter, attacked or not.
    """

    true_fixes: Sequence[TrueFix]
    elapsed_s: float
    interval_s: float
    heading_rad: float
    innovation: Callable[[], Innovation]
    past_nis: Sequence[float] = ()

    @property
    def position_m(self) -> Float64:
        """The true fix (3,) in the map."""
        return self.true_fixes[-1].position_m

    @property
    def is_first(self) -> bool:
        """Whether a span of attacked fixes begins: a growing offset restarts at zero."""
        return self.elapsed_s == 0


Spoofer = Callable[[SpoofingContext], Float64 | None]
"""Returns the false fix (3,) in the map, or None for no fix; called for each attacked fix in order."""


@dataclass(frozen=True, kw_only=True)
class GnssTraits(Traits):
    """Properties of a GPS attack that do not depend on its parameters.

    needs_filter: whether it uses `SpoofingContext.innovation`; its victim must then be a vehicle with a
    filter in the bag, not a station with CAMs alone.
    """

    needs_filter: bool = False


class GnssAttack(Attack):
    """A GPS attack. Its constructor takes and checks keyword-only parameters, with defaults and units in
    their names. The class declares its `traits`:

    >>> class North(GnssAttack):
    ...     traits = GnssTraits()
    ...
    ...     def __init__(self, *, offset_m: float = 10.0) -> None:
    ...         self.offset_m = offset_m
    ...
    ...     def begin(self, rng):
    ...         return lambda context: context.position_m + [0.0, self.offset_m, 0.0]

    `bounds` are the limits that it keeps: a fix beyond them is refused, and `verify` measures them again. Two
    attacks on one vehicle cannot be active at the same time, as a receiver reports one position.
    """

    family = "gnss"
    family_title = "GNSS: replace the GPS fixes of a vehicle"
    usual_options = "--victim ego"
    own_keys = ("network",)
    traits_type = GnssTraits
    quantities = FIX_QUANTITIES

    @property
    @abstractmethod
    def traits(self) -> GnssTraits: ...

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each quantity that the attack bounds, in every attacked fix, by names of
        `advpipe.pipeline.labels.fix_quantities`; empty if it bounds none."""
        return {}

    @abstractmethod
    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Start the attack on one victim; all random draws come from `rng`."""


def gnss_traits(attack_class: type[GnssAttack]) -> GnssTraits:
    """The traits of a class."""
    found: GnssTraits = vars(attack_class)["traits"]
    return found


def horizontal_unit(angle_rad: float) -> Float64:
    """The horizontal unit vector (3,) at an angle from the map's x axis."""
    return np.array([math.cos(angle_rad), math.sin(angle_rad), 0.0])


def random_direction(rng: np.random.Generator) -> Float64:
    """A random horizontal unit vector (3,), uniform in direction."""
    return horizontal_unit(float(rng.uniform(0, math.tau)))
