"""Defences that transform the whole scene for the detector; its boxes are mapped back."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from advpipe.pipeline.defences.base import DefendedCloud, Placement
from advpipe.pipeline.defences.rounding import positive
from advpipe.pipeline.messages.cloud import Cloud


class Shift:
    """Shifts the cloud against the voxel grid: randomly by up to `max_m` along each axis.

    Half a voxel is enough to cross any face; the default is half of the shipped detector's 10 cm.
    """

    is_default: ClassVar[bool] = True

    def __init__(self, *, max_m: float = 0.05) -> None:
        self.max_m = positive("shift", "max_m", max_m)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(offset_m=rng.uniform(-self.max_m, self.max_m, 3))
        return DefendedCloud(placement.cloud(cloud), placement)


class Flip:
    """Mirrors the cloud: left becomes right."""

    is_default: ClassVar[bool] = True

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(is_mirrored=True)
        return DefendedCloud(placement.cloud(cloud), placement)


class Scale:
    """Scales the cloud: everything is `factor` times as large and as far away."""

    is_default: ClassVar[bool] = False

    def __init__(self, *, factor: float = 1.025) -> None:
        self.factor = positive("scale", "factor", factor)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        placement = Placement(scale=self.factor)
        return DefendedCloud(placement.cloud(cloud), placement)
