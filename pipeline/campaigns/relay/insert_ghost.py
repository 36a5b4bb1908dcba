"""Ghost insertion: an object that is not there returns the sensor's rays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import MOVED, PointLabels
from advpipe.pipeline.labels.quantities import POINTS_ADDED, POINTS_REMOVED
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarResult, LidarTraits

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class InsertGhost(LidarAttack):
    """Each ray that meets the ghost before its own echo returns from the ghost's surface instead.

    The ghost is a box: distance_m from the sensor to its centre; angle_deg of that direction, anticlockwise
    from the sensor's x axis; yaw_deg of its length; bottom_m in the sensor's frame, where the ground is.
    noise_m: standard deviation of the ranges. Points keep their intensity. It queries no detector.
    """

    traits = LidarTraits(
        budget=Budget(title="Distance of the ghost in m", parameter="distance_m", unit="m", default=12.0)
    )

    distance_m: float = 12.0
    angle_deg: float = 0.0
    yaw_deg: float = 0.0
    bottom_m: float = -1.8
    length_m: float = 4.2
    width_m: float = 1.8
    height_m: float = 1.5
    noise_m: float = 0.01

    def __post_init__(self) -> None:
        for name, least, most in (
            ("distance_m", 1, 500),
            ("angle_deg", -360, 360),
            ("yaw_deg", -360, 360),
            ("bottom_m", -100, 100),
            *((size, 0.1, 50) for size in ("length_m", "width_m", "height_m")),
            ("noise_m", 0, 1),
        ):
            checked_number("insert-ghost", name, getattr(self, name), least, most)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {POINTS_REMOVED.name: (0, 0), POINTS_ADDED.name: (0, 0)}

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud with the points of rays that meet the ghost on its surface."""
        near = np.flatnonzero(self._may_meet(cloud))
        points_m = xyz(cloud[near]).astype(np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = self._share_of_ray(points_m)
        meets = share < 1
        hit, points_m, share = near[meets], points_m[meets], share[meets]
        share += rng.normal(scale=self.noise_m, size=len(hit)) / np.linalg.norm(points_m, axis=1)
        ghost = cloud.copy()
        for column, axis in enumerate("xyz"):
            ghost[axis][hit] = points_m[:, column] * share
        moved_m = np.linalg.norm(xyz(ghost[hit]).astype(np.float64) - points_m, axis=1)
        return LidarResult(ghost, PointLabels(hit, np.full(len(hit), MOVED), moved_m))

    def _may_meet(self, cloud: Cloud) -> npt.NDArray[np.bool_]:
        """Points (N,) beyond the ghost's near end, in the sector that a circle around its outline fills; the
        others need no closer look."""
        angle_rad, radius_m = math.radians(self.angle_deg), math.hypot(self.length_m, self.width_m) / 2
        forward_m = cloud["x"] * math.cos(angle_rad) + cloud["y"] * math.sin(angle_rad)
        side_m = cloud["y"] * math.cos(angle_rad) - cloud["x"] * math.sin(angle_rad)
        if radius_m >= self.distance_m:
            return np.isfinite(forward_m)
        tangent = radius_m / math.sqrt(self.distance_m**2 - radius_m**2) * 1.001
        found: npt.NDArray[np.bool_] = np.abs(side_m) <= forward_m * tangent
        return found

    def _share_of_ray(self, points_m: Float64) -> Float64:
        """Where the ray from the sensor to each point (N, 3) enters the box, in shares of it; infinite where
        it misses the box. By the slab method."""
        angle_rad, yaw_rad = math.radians(self.angle_deg), math.radians(self.yaw_deg)
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        box_R_sensor = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        middle_m = self.bottom_m + self.height_m / 2
        centre_m = np.array(
            [self.distance_m * math.cos(angle_rad), self.distance_m * math.sin(angle_rad), middle_m]
        )
        rays_m, start_m = points_m @ box_R_sensor.T, -box_R_sensor @ centre_m
        half_m = np.array([self.length_m, self.width_m, self.height_m]) / 2
        ends = np.stack([(sign * half_m - start_m) / rays_m for sign in (-1, 1)])
        enters, leaves = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        return np.where((enters <= leaves) & (enters > 0), enters, np.inf)
