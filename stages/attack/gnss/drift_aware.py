"""Innovation-aware drift: as fast as the victim's innovation test permits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.pipeline.localisation.monitor import MONITOR_PROBABILITY, WINDOW_FIXES, nis_threshold
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, horizontal_unit

MONITORS = ("fix", "window")


@dataclass(frozen=True, kw_only=True)
class DriftAware(GnssAttack):
    """A drift, as fast as the innovation test nis <= gate of the victim's filter lets it be.

    Each offset is the largest with which the normalised innovation squared stays within share times the
    chi-square quantile of 3 degrees of freedom at gate_probability, or the one with the smallest innovation
    if there is none. It never changes sides, nor exceeds most_m. rate_mps: the fastest that it may grow;
    without, only the test limits it. monitor: `fix` evades the test of a single fix; `window` also that of
    the sum over the last window_fixes fixes, which `evaluate` has beside it. TDRobertson's
    INNOVATION_AWARE_GRADUAL_DRIFT for CARLA throttles at 70 % of a threshold in metres; share is this
    fraction for the tests of `evaluate`. As a worst case, the spoofer knows the filter and all its
    measurements. angle_deg: as in `drift`.
    """

    traits = GnssTraits(needs_filter=True)

    rate_mps: float | None = None
    angle_deg: float = 90.0
    most_m: float = 1000.0
    share: float = 0.7
    gate_probability: float = MONITOR_PROBABILITY
    monitor: str = "fix"
    window_fixes: int = WINDOW_FIXES

    def __post_init__(self) -> None:
        if self.rate_mps is not None:
            checked_number("gnss-drift-aware", "rate_mps", self.rate_mps, 0, 1e4)
        checked_number("gnss-drift-aware", "angle_deg", self.angle_deg, -360.0, 360.0)
        checked_number("gnss-drift-aware", "most_m", self.most_m, 0, 1e6)
        checked_number("gnss-drift-aware", "share", self.share, 0.01, 1.0)
        checked_number("gnss-drift-aware", "gate_probability", self.gate_probability, 0.5, 1 - 1e-9)
        checked_choice("gnss-drift-aware", "monitor", self.monitor, MONITORS)
        checked_integer("gnss-drift-aware", "window_fixes", self.window_fixes, 1, 10_000)

    def allowed_nis(self, past_nis: Sequence[float] = ()) -> float:
        """The largest normalised innovation squared that the next attacked fix may have, after those of all
        fixes before it."""
        allowed = self.share * nis_threshold(1, self.gate_probability)
        if self.monitor == "fix":
            return allowed
        before = past_nis[max(len(past_nis) - self.window_fixes + 1, 0) :]
        total = self.share * nis_threshold(len(before) + 1, self.gate_probability)
        return min(allowed, total - sum(before))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {FIX_DISPLACEMENT.name: (0, self.most_m), FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """No random draws."""
        direction, offset_m = np.zeros(3), 0.0

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal direction, offset_m
            if context.is_first:
                direction, offset_m = horizontal_unit(context.heading_rad + math.radians(self.angle_deg)), 0.0
            allowed = self.allowed_nis(context.past_nis)
            low_m, high_m = undetected_range_m(context.innovation(), direction, allowed)
            wanted_m = high_m
            if self.rate_mps is not None:
                wanted_m = offset_m + self.rate_mps * context.interval_s
            offset_m = min(max(min(max(wanted_m, low_m), high_m), 0.0), self.most_m)
            return context.position_m + offset_m * direction

        return spoof


def undetected_range_m(innovation: Innovation, direction: Float64, allowed_nis: float) -> tuple[float, float]:
    """The smallest and largest offset along a unit vector (3,) with which a fix passes the innovation test.

    With residual r and covariance S of the true fix, nis(a) = (r + a d)' S^-1 (r + a d) is a parabola: these
    are the roots of nis(a) = allowed_nis. Without roots, both are the a of its minimum.
    """
    weighted = np.linalg.solve(innovation.covariance_m2, direction)
    curvature = float(direction @ weighted)
    middle_m = -float(innovation.residual_m @ weighted) / curvature
    lowest = innovation.nis - curvature * middle_m**2
    half_m = math.sqrt(max((allowed_nis - lowest) / curvature, 0.0))
    return middle_m - half_m, middle_m + half_m
