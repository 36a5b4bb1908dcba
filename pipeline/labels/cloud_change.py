"""A clean cloud and what an attack made of it, and what can be measured of the points that it changed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.labels.points import ADDED, MOVED, REMOVED, PointLabels
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CloudChange:
    """A clean cloud (N,), what an attack made of it, and labels that state exactly what differs. The points
    that were not removed keep their order."""

    clean: Cloud
    adversarial: Cloud
    labels: PointLabels

    def count(self, action: str) -> int:
        """The number of points with this action."""
        return int((self.labels.action == action).sum())

    @cached_property
    def finite(self) -> int:
        """How many points of the clean cloud have coordinates and an intensity."""
        return int(np.isfinite(xyzi(self.clean)).all(axis=1).sum())

    @cached_property
    def added(self) -> Cloud:
        """The added points, in the order of their labels."""
        found: Cloud = self.adversarial[self.labels.places(len(self.clean))[self.labels.action == ADDED]]
        return found

    @cached_property
    def survivors(self) -> tuple[Cloud, Cloud]:
        """The points that were not removed, before and after."""
        labels = self.labels
        kept, ours = np.ones(len(self.clean), bool), np.ones(len(self.adversarial), bool)
        kept[labels.point[labels.action == REMOVED]] = False
        ours[labels.places(len(self.clean))[labels.action == ADDED]] = False
        return self.clean[kept], self.adversarial[ours]

    @cached_property
    def moved(self) -> tuple[Cloud, Cloud]:
        """The moved points before and after."""
        is_moved = self.labels.action == MOVED
        places = self.labels.places(len(self.clean))[is_moved]
        return self.clean[self.labels.point[is_moved]], self.adversarial[places]

    @cached_property
    def offset_m(self) -> Float64:
        """By how much each moved point was moved along x, y and z (K, 3), in double precision."""
        before, after = self.moved
        offset_m: Float64 = xyz(after).astype(np.float64) - xyz(before).astype(np.float64)
        return offset_m

    @cached_property
    def displacement_m(self) -> Float64:
        """How far each moved point was moved."""
        moved_m: Float64 = np.linalg.norm(self.offset_m, axis=1)
        return moved_m

    @cached_property
    def off_ray_urad(self) -> Float64:
        """The angle at the sensor between where each moved point was and where it is, in microradians."""
        before, after = (xyz(points).astype(np.float64) for points in self.moved)
        across = np.linalg.norm(np.cross(before, after), axis=1)
        angle_rad: Float64 = np.arctan2(across, (before * after).sum(axis=1))
        return 1e6 * angle_rad

    @cached_property
    def added_distance_m(self) -> Float64:
        """The distance of each added point to the nearest point of the clean cloud."""
        from scipy.spatial import cKDTree

        added = self.added
        scene = xyz(self.clean[np.isfinite(xyzi(self.clean)).all(axis=1)]).astype(np.float64)
        if not len(added) or not len(scene):
            return np.full(len(added), np.inf)
        tree = cKDTree(scene, balanced_tree=False, compact_nodes=False)  # few queries: most time is building
        distance_m: Float64 = tree.query(xyz(added).astype(np.float64))[0]
        return distance_m

    @cached_property
    def intensity_change(self) -> Float64:
        """The absolute change of the intensity of each moved point."""
        before, after = self.moved
        change: Float64 = np.abs(after["intensity"].astype(np.float64) - before["intensity"])
        return change
