"""What can be measured of a cloud that an attack changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.labels.points import ADDED, MOVED, REMOVED, PointLabels
from advpipe.pipeline.labels.quantity import Quantity
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CloudChange:
    """A clean cloud (N,), what an attack made of it, and labels that tell exactly what differs: the points
    that were not removed in their order, and then those added."""

    clean: Cloud
    adversarial: Cloud
    labels: PointLabels

    def count(self, action: str) -> int:
        return int((self.labels.action == action).sum())

    @cached_property
    def finite(self) -> int:
        """How many points of the clean cloud have a place and an intensity."""
        return int(np.isfinite(xyzi(self.clean)).all(axis=1).sum())

    @cached_property
    def moved(self) -> tuple[Cloud, Cloud]:
        """The moved points before and after."""
        labels = self.labels
        kept = np.ones(len(self.clean), bool)
        kept[labels.point[labels.action == REMOVED]] = False
        place = np.cumsum(kept) - 1
        points = labels.point[labels.action == MOVED]
        return self.clean[points], self.adversarial[place[points]]

    @cached_property
    def displacement_m(self) -> Float64:
        """How far each moved point was moved, in double precision."""
        before, after = self.moved
        moved_m: Float64 = np.linalg.norm(
            xyz(after).astype(np.float64) - xyz(before).astype(np.float64), axis=1
        )
        return moved_m

    @cached_property
    def added_distance_m(self) -> Float64:
        """How far each added point stands from the nearest point of the clean cloud."""
        from scipy.spatial import cKDTree

        added = self.adversarial[len(self.adversarial) - self.count(ADDED) :]
        scene = xyz(self.clean[np.isfinite(xyzi(self.clean)).all(axis=1)]).astype(np.float64)
        if not len(added) or not len(scene):
            return np.full(len(added), np.inf)
        distance_m: Float64 = cKDTree(scene).query(xyz(added).astype(np.float64))[0]
        return distance_m

    @cached_property
    def intensity_change(self) -> Float64:
        """By how much the intensity of each moved point changed, either way."""
        before, after = self.moved
        change: Float64 = np.abs(after["intensity"].astype(np.float64) - before["intensity"])
        return change


def _most(values: Float64) -> float:
    return float(values.max(initial=0.0))


def _mean(values: Float64) -> float:
    return float(values.mean()) if len(values) else 0.0


def _share_removed(change: CloudChange) -> float:
    """Of a share and N points, the nearest whole number is removed, halves up, and one at least."""
    removed = change.count(REMOVED)
    return 0.0 if removed <= 1 else (removed - 0.5) / max(change.finite, 1)


MAX_DISPLACEMENT = Quantity[CloudChange](
    "max_displacement_m", "m", "largest displacement of a point", lambda change: _most(change.displacement_m)
)
MEAN_SQUARE_DISPLACEMENT = Quantity[CloudChange](
    "mean_square_displacement_m2",
    "m²",
    "mean squared displacement of the moved points",
    lambda change: _mean(change.displacement_m**2),
)
ADDED_DISTANCE = Quantity[CloudChange](
    "max_added_distance_m",
    "m",
    "largest distance of an added point from the clean cloud",
    lambda change: _most(change.added_distance_m),
)
MAX_INTENSITY_CHANGE = Quantity[CloudChange](
    "max_intensity_change",
    "1",
    "largest change of an intensity",
    lambda change: _most(change.intensity_change),
)
POINTS_MOVED = Quantity[CloudChange]("points_moved", "1", "points moved", lambda change: change.count(MOVED))
POINTS_ADDED = Quantity[CloudChange]("points_added", "1", "points added", lambda change: change.count(ADDED))
POINTS_REMOVED = Quantity[CloudChange](
    "points_removed", "1", "points removed", lambda change: change.count(REMOVED)
)
POINTS_TOUCHED = Quantity[CloudChange](
    "points_touched",
    "1",
    "points moved or removed",
    lambda change: change.count(MOVED) + change.count(REMOVED),
)
SHARE_REMOVED = Quantity[CloudChange](
    "share_removed", "1", "smallest share of the points that rounds to the number removed", _share_removed
)

CLOUD_QUANTITIES: Mapping[str, Quantity[CloudChange]] = {
    quantity.name: quantity
    for quantity in (
        *(MAX_DISPLACEMENT, MEAN_SQUARE_DISPLACEMENT, ADDED_DISTANCE, MAX_INTENSITY_CHANGE),
        *(POINTS_MOVED, POINTS_ADDED, POINTS_REMOVED, POINTS_TOUCHED, SHARE_REMOVED),
    )
}
