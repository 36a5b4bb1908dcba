"""Fixes whose error walks at random."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext


@dataclass(frozen=True, kw_only=True)
class RandomWalk(GnssAttack):
    """The horizontal offset is a Brownian motion from zero at the begin of a span.

    From one attacked fix to the next, t later, each axis moves by a normal draw of standard deviation
    stddev_m * sqrt(t / 1 s). Where it would leave the circle of most_m about zero, it goes to the circle's
    edge. stddev_m: the 2 m of TDRobertson's RANDOM_WALK for CARLA, taken for one second.
    """

    traits = GnssTraits()

    stddev_m: float = 2.0
    most_m: float = 50.0

    def __post_init__(self) -> None:
        checked_number("gnss-walk", "stddev_m", self.stddev_m, 0, 1e6)
        checked_number("gnss-walk", "most_m", self.most_m, 0, 1e6)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {FIX_DISPLACEMENT.name: (0, self.most_m), FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Two draws for each attacked fix; those of a span's first count for nothing."""
        offset_m = np.zeros(3)

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal offset_m
            step_m = self.stddev_m * math.sqrt(context.interval_s) * rng.standard_normal(2)
            offset_m = np.zeros(3) if context.is_first else offset_m + [*step_m, 0.0]
            length_m = float(np.linalg.norm(offset_m))
            if length_m > self.most_m:
                offset_m = offset_m * (self.most_m / length_m)
            return context.position_m + offset_m

        return spoof
