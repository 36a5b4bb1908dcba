"""Fixes that slide away as fast as the victim's own innovation test lets them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, horizontal_unit


@dataclass(frozen=True, kw_only=True)
class DriftAware(GnssAttack):
    """A drift, throttled so that no fix fails the test nis <= gate of the victim's filter.

    The offset grows by rate_mps, unless the normalised innovation squared would exceed share times the
    chi-square quantile of 3 degrees of freedom at gate_probability: then it is the nearest offset that keeps
    below it, or the one of least innovation where none does. It never changes sides, nor exceeds most_m.
    TDRobertson's INNOVATION_AWARE_GRADUAL_DRIFT for CARLA throttles at 70 % of a threshold in metres;
    share is that, on the test of `evaluate`. The spoofer knows the filter and all that it measures: the
    worst case. angle_deg: as in `drift`.
    """

    traits = GnssTraits(needs_filter=True)

    rate_mps: float = 1.0
    angle_deg: float = 90.0
    most_m: float = 50.0
    share: float = 0.7
    gate_probability: float = 0.999

    def __post_init__(self) -> None:
        checked_number("gnss-drift-aware", "rate_mps", self.rate_mps, 0, 1e4)
        checked_number("gnss-drift-aware", "angle_deg", self.angle_deg, -360.0, 360.0)
        checked_number("gnss-drift-aware", "most_m", self.most_m, 0, 1e6)
        checked_number("gnss-drift-aware", "share", self.share, 0.01, 1.0)
        checked_number("gnss-drift-aware", "gate_probability", self.gate_probability, 0.5, 1 - 1e-9)

    @property
    def allowed_nis(self) -> float:
        """No attacked fix is to have a larger normalised innovation squared."""
        from scipy.special import chdtri

        return self.share * float(chdtri(3, 1 - self.gate_probability))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {FIX_DISPLACEMENT.name: (0, self.most_m), FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws nothing."""
        direction, offset_m, allowed = np.zeros(3), 0.0, self.allowed_nis

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal direction, offset_m
            if context.is_first:
                direction, offset_m = horizontal_unit(context.heading_rad + math.radians(self.angle_deg)), 0.0
            low_m, high_m = undetected_range_m(context.innovation(), direction, allowed)
            wanted_m = offset_m + self.rate_mps * context.interval_s
            offset_m = min(max(min(max(wanted_m, low_m), high_m), 0.0), self.most_m)
            return context.position_m + offset_m * direction

        return spoof


def undetected_range_m(innovation: Innovation, direction: Float64, allowed_nis: float) -> tuple[float, float]:
    """From which to which offset along a unit vector (3,) the innovation of a fix passes the test.

    With residual r and covariance S of the genuine fix, nis(a) = (r + a d)' S^-1 (r + a d) is a parabola:
    these are the roots of nis(a) = allowed_nis. Where it has none, twice the a of its lowest point.
    """
    weighted = np.linalg.solve(innovation.covariance_m2, direction)
    curvature = float(direction @ weighted)
    middle_m = -float(innovation.residual_m @ weighted) / curvature
    lowest = innovation.nis - curvature * middle_m**2
    half_m = math.sqrt(max((allowed_nis - lowest) / curvature, 0.0))
    return middle_m - half_m, middle_m + half_m
