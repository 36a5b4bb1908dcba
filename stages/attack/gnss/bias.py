"""Random Bias Attack (RBA): every fix is off by the same random vector."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.pipeline.localisation.gnss import HEIGHT_FACTOR
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext


@dataclass(frozen=True, kw_only=True)
class Bias(GnssAttack):
    """x_adv = x + delta with delta_i uniform in [-Delta_i, Delta_i], drawn once for a victim (the paper,
    section on communication attacks: "a random constant error").

    bound_m: Delta of each horizontal axis of the map, by default three standard deviations of a fix (1 m of
    wandering, 0.3 m white), "the maximum plausible GPS error". bound_up_m: Delta of the height, by default
    as much larger as heights err more. A fix holds no heading, so none is biased.
    """

    traits = GnssTraits(also_known_as=("rba", "gnss-rba"))

    bound_m: float = 3.0
    bound_up_m: float = 3.0 * HEIGHT_FACTOR

    def __post_init__(self) -> None:
        checked_number("gnss-bias", "bound_m", self.bound_m, 0, 1e6)
        checked_number("gnss-bias", "bound_up_m", self.bound_up_m, 0, 1e4)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        most_m = math.hypot(self.bound_m, self.bound_m, self.bound_up_m)
        return {FIX_DISPLACEMENT.name: (0, most_m), FIX_HEIGHT_CHANGE.name: (0, self.bound_up_m)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws the bias."""
        delta_m = rng.uniform(-1, 1, 3) * (self.bound_m, self.bound_m, self.bound_up_m)

        def spoof(context: SpoofingContext) -> np.ndarray:
            return context.position_m + delta_m

        return spoof
