"""Random jumps of the fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.stages.attack.bounds import checked_choice, checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, random_direction

MODES = ("glitch", "step")


@dataclass(frozen=True, kw_only=True)
class Jump(GnssAttack):
    """Each attacked fix jumps by distance_m with a probability, in a random horizontal direction.

    The first fix of each span jumps in any case, so that no span goes by without a jump; with probability 0
    none does. mode `glitch`: only this fix jumps. mode `step`: later fixes keep the offset until the span
    ends, and jumps add up. The defaults are those of TDRobertson's SUDDEN_JUMP for CARLA: 5 m, probability
    0.02 for each fix.
    """

    traits = GnssTraits()

    mode: str = "glitch"
    distance_m: float = 5.0
    probability: float = 0.02

    def __post_init__(self) -> None:
        checked_choice("gnss-jump", "mode", self.mode, MODES)
        checked_number("gnss-jump", "distance_m", self.distance_m, 0, 1e6)
        checked_number("gnss-jump", "probability", self.probability, 0, 1.0)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """No bound on the distance of `step`, whose jumps add up."""
        farthest = {FIX_DISPLACEMENT.name: (0, self.distance_m)} if self.mode == "glitch" else {}
        return {**farthest, FIX_HEIGHT_CHANGE.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Two draws for each attacked fix."""
        offset_m = np.zeros(3)

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal offset_m
            if context.is_first or self.mode == "glitch":
                offset_m = np.zeros(3)
            jumps, direction = rng.random() < self.probability, random_direction(rng)
            if jumps or (context.is_first and self.probability > 0):
                offset_m = offset_m + self.distance_m * direction
            return context.position_m + offset_m

        return spoof
