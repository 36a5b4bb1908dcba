"""Sector removal: no echoes from some directions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import POINTS_ADDED, POINTS_MOVED
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarResult, LidarTraits


@dataclass(frozen=True, kw_only=True)
class RemoveSector(LidarAttack):
    """Removes all points in a sector around the sensor.

    width_deg: of the sector. centre_deg: its middle, anticlockwise from the sensor's x axis. nearest_m,
    farthest_m: horizontal distances between which points are removed. It queries no detector.
    """

    traits = LidarTraits(
        budget=Budget(title="Removed sector in °", parameter="width_deg", unit="°", default=20.0)
    )

    width_deg: float = 20.0
    centre_deg: float = 0.0
    nearest_m: float = 0.0
    farthest_m: float = 200.0

    def __post_init__(self) -> None:
        checked_number("remove-sector", "width_deg", self.width_deg, 0, 360)
        checked_number("remove-sector", "centre_deg", self.centre_deg, -360, 360)
        checked_number("remove-sector", "nearest_m", self.nearest_m, 0, 1e4)
        checked_number("remove-sector", "farthest_m", self.farthest_m, 0, 1e4)
        if self.nearest_m >= self.farthest_m:
            raise UsageError(
                f"remove-sector: nearest_m {self.nearest_m:g} is not below farthest_m {self.farthest_m:g}"
            )

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {POINTS_MOVED.name: (0, 0), POINTS_ADDED.name: (0, 0)}

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud without the sector's points."""
        off_rad = np.arctan2(cloud["y"], cloud["x"]) - math.radians(self.centre_deg)
        distance_m = np.hypot(cloud["x"], cloud["y"])
        is_removed = np.cos(off_rad) >= math.cos(math.radians(self.width_deg / 2))
        is_removed &= (distance_m >= self.nearest_m) & (distance_m <= self.farthest_m)
        return LidarResult(cloud[~is_removed], PointLabels.removed(np.flatnonzero(is_removed)))
