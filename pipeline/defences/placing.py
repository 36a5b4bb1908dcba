"""Defences that show the detector the same world in another place; boxes come back from there."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.defences.base import DefendedCloud, Placement
from advpipe.pipeline.defences.rounding import positive
from advpipe.pipeline.messages.cloud import Cloud


class Shift:
    """The cloud moves against the voxel grid: by up to `max_m` along each axis, drawn for each cloud.

    Half a voxel is enough to cross any face; the default is half of the 10 cm that the shipped detector has.
    """

    def __init__(self, *, max_m: float = 0.05) -> None:
        self.max_m = positive("shift", "max_m", max_m)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(offset_m=rng.uniform(-self.max_m, self.max_m, 3))
        return DefendedCloud(placement.cloud(cloud), placement)


class Flip:
    """Left becomes right: y is mirrored."""

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(is_mirrored=True)
        return DefendedCloud(placement.cloud(cloud), placement)


class Scale:
    """Everything is `factor` times as large and as far away."""

    def __init__(self, *, factor: float = 1.025) -> None:
        self.factor = positive("scale", "factor", factor)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(scale=self.factor)
        return DefendedCloud(placement.cloud(cloud), placement)
