"""Other views of a scene, drawn at random: what a detector has learnt not to depend on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.defences.base import DefendedCloud, Placement
from advpipe.pipeline.messages.cloud import Cloud

TURN_RAD = math.pi / 8
SCALES = (0.95, 1.05)
SHIFT_M = 0.08
"""The widest draws: half of the turn that detectors are trained with, so that few objects leave the range;
their scales; half of the widest column of our families."""


@dataclass(frozen=True)
class InputDiversity:
    """Turns, scales and shifts a scene, and mirrors it or not; in the place of a `Defence`."""

    is_mirrored: bool

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(
            scale=rng.uniform(*SCALES),
            is_mirrored=self.is_mirrored,
            offset_m=rng.uniform(-SHIFT_M, SHIFT_M, 3),
            yaw_rad=rng.uniform(-TURN_RAD, TURN_RAD),
        )
        return DefendedCloud(placement.cloud(cloud), placement)
