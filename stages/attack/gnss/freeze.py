"""Frozen fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext


@dataclass(frozen=True, kw_only=True)
class Freeze(GnssAttack):
    """Repeats the true fix at the start of a span (Simutack's "No Update" on its GNSS sensor)."""

    traits = GnssTraits()

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """No random draws."""
        frozen_m = np.zeros(3)

        def spoof(context: SpoofingContext) -> np.ndarray:
            nonlocal frozen_m
            if context.is_first:
                frozen_m = context.position_m
            return frozen_m

        return spoof
