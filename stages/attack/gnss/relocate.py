"""Position Altering Attack (PAA): the victim is somewhere else, far from where it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.stages.attack.bounds import checked_choice, checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, random_direction

MODES = ("offset", "place")


@dataclass(frozen=True, kw_only=True)
class Relocate(GnssAttack):
    """The paper's PAA: "a fictitious location far from its true position", "beyond normal error bounds".

    Both ways that it names: mode `offset` injects "a large bias", which moves along with the vehicle;
    mode `place` reports "entirely fabricated coordinates", one place all along a span. The distance from the
    genuine fix (at the span's begin for `place`) is uniform in [least_m, most_m], its direction uniform in
    the plane; both are drawn once for a victim. The height stays. The paper gives no figures: the defaults
    are ours, and least_m is at least 10 m, which no fix of the default receiver errs by.
    """

    traits = GnssTraits(also_known_as=("paa", "gnss-paa"))

    mode: str = "offset"
    least_m: float = 50.0
    most_m: float = 150.0

    def __post_init__(self) -> None:
        checked_choice("gnss-relocate", "mode", self.mode, MODES)
        checked_number("gnss-relocate", "least_m", self.least_m, 10.0, 1e6)
        checked_number("gnss-relocate", "most_m", self.most_m, 10.0, 1e6)
        if self.least_m > self.most_m:
            raise UsageError(f"gnss-relocate: least_m {self.least_m:g} is above most_m {self.most_m:g}")

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """None of `place`, which the vehicle may leave behind."""
        if self.mode == "place":
            return {}
        return {FIX_DISPLACEMENT.name: (self.least_m, self.most_m), FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws how far away, and where to."""
        away_m = rng.uniform(self.least_m, self.most_m) * random_direction(rng)
        place_m = np.zeros(3)

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal place_m
            if self.mode == "offset" or context.is_first:
                place_m = context.position_m + away_m
            return place_m

        return spoof
