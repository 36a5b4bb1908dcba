"""No fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.stages.attack.gnss.base import Sight, Spoofer


@dataclass(frozen=True, kw_only=True)
class Jam:
    """The receiver finds no satellites: STATUS_NO_FIX and no place (sensor_msgs/NavSatStatus)."""

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws nothing."""

        def spoof(sight: Sight) -> None:
            return None

        return spoof
