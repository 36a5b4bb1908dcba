"""Jamming: no fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext


@dataclass(frozen=True, kw_only=True)
class Jam(GnssAttack):
    """The receiver finds no satellites: STATUS_NO_FIX and no position (sensor_msgs/NavSatStatus)."""

    traits = GnssTraits()

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """No random draws."""

        def spoof(context: SpoofingContext) -> None:
            return None

        return spoof
