"""A clean cloud and what an attack made of it, and what can be measured of the points that it changed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.lengths import lengths
from advpipe.pipeline.geometry.nearest_points import nearest_points
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.messages.cloud import Cloud, chosen_points, is_finite, xyz

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
        return int(is_finite(self.clean).sum())

    @cached_property
    def added(self) -> Cloud:
        """The added points, in the order of their labels."""
        return chosen_points(self.adversarial, self.labels.places(len(self.clean))[self.labels.is_added])

    @cached_property
    def survivors(self) -> tuple[Cloud, Cloud]:
        """The points that were not removed, before and after."""
        labels = self.labels
        kept, ours = np.ones(len(self.clean), bool), np.ones(len(self.adversarial), bool)
        kept[labels.point[labels.is_removed]] = False
        ours[labels.places(len(self.clean))[labels.is_added]] = False
        return chosen_points(self.clean, kept), chosen_points(self.adversarial, ours)

    @cached_property
    def moved(self) -> tuple[Cloud, Cloud]:
        """The moved points before and after."""
        is_moved = self.labels.is_moved
        places = self.labels.places(len(self.clean))[is_moved]
        before = chosen_points(self.clean, self.labels.point[is_moved])
        return before, chosen_points(self.adversarial, places)

    @cached_property
    def offset_m(self) -> Float64:
        """By how much each moved point was moved along x, y and z (K, 3), in double precision."""
        before, after = self.moved
        offset_m: Float64 = xyz(after).astype(np.float64) - xyz(before).astype(np.float64)
        return offset_m

    @cached_property
    def displacement_m(self) -> Float64:
        """How far each moved point was moved."""
        moved_m: Float64 = lengths(self.offset_m)
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
        return nearest_points(xyz(self.clean)[is_finite(self.clean)], xyz(self.added))[0]

    @cached_property
    def intensity_change(self) -> Float64:
        """The absolute change of the intensity of each moved point."""
        before, after = self.moved
        change: Float64 = np.abs(after["intensity"].astype(np.float64) - before["intensity"])
        return change
