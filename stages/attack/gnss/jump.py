"""Fixes that jump now and then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE
from advpipe.stages.attack.bounds import checked_choice, checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext, random_direction

MODES = ("glitch", "step")


@dataclass(frozen=True, kw_only=True)
class Jump(GnssAttack):
    """Each attacked fix jumps with a probability by distance_m, in a direction uniform in the plane.

    mode `glitch`: this fix alone is off. mode `step`: it and all after it are, until a span ends; jumps add
    up. The defaults are those of TDRobertson's SUDDEN_JUMP for CARLA: 5 m, probability 0.02 for each fix.
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
        """Jumps of `step` add up without end."""
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
            if jumps:
                offset_m = offset_m + self.distance_m * direction
            return context.position_m + offset_m

        return spoof
