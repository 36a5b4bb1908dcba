"""Fixes that slowly slide away."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, horizontal_unit


@dataclass(frozen=True, kw_only=True)
class Drift(GnssAttack):
    """offset(t) = min(rate_mps * t, most_m) in one direction, t from the begin of a span.

    rate_mps: the 0.2 m/s of TDRobertson's GRADUAL_DRIFT for CARLA. angle_deg: the direction, anticlockwise
    from where the victim heads at the begin of a span; 90 is to its left, out of its lane, which is what
    Shen et al. aim for ("Drift with Devil", USENIX Security 2020).
    """

    traits = GnssTraits()

    rate_mps: float = 0.2
    angle_deg: float = 90.0
    most_m: float = 50.0

    def __post_init__(self) -> None:
        checked_number("gnss-drift", "rate_mps", self.rate_mps, 0, 1e4)
        checked_number("gnss-drift", "angle_deg", self.angle_deg, -360.0, 360.0)
        checked_number("gnss-drift", "most_m", self.most_m, 0, 1e6)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {FIX_DISPLACEMENT.name: (0, self.most_m), FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws nothing."""
        direction = np.zeros(3)

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal direction
            if context.is_first:
                direction = horizontal_unit(context.heading_rad + math.radians(self.angle_deg))
            return context.position_m + min(self.rate_mps * context.elapsed_s, self.most_m) * direction

        return spoof
