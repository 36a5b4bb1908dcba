"""How far an attack moved the points of a cloud, and how far from the cloud it put new ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference


@dataclass(frozen=True, slots=True)
class Displacement:
    """Lengths in metres, in float64 from the coordinates as stored; zeros where no point was moved.

    count: of the moved points. max_added_m: from an added point to the nearest point of the clean cloud.
    """

    count: int = 0
    mean_m: float = 0.0
    rms_m: float = 0.0
    median_m: float = 0.0
    p95_m: float = 0.0
    max_m: float = 0.0
    max_added_m: float = 0.0

    @classmethod
    def of(cls, clean: Cloud, cloud: Cloud, change: CloudDifference) -> Displacement:
        """The displacements of one adversarial cloud, in metres."""
        reach_m = added_distance_m(clean, cloud, change)
        moved_m = change.displacement_m
        if not len(moved_m):
            return cls(max_added_m=reach_m)
        median_m, p95_m = np.quantile(moved_m, [0.5, 0.95])
        return cls(
            len(moved_m),
            float(moved_m.mean()),
            float(np.sqrt(np.square(moved_m).mean())),
            float(median_m),
            float(p95_m),
            float(moved_m.max()),
            reach_m,
        )

    @classmethod
    def over(cls, frames: Sequence[Displacement]) -> Displacement:
        """Of all points of several frames; the median and the 95th percentile are means over the frames."""
        moved = [each for each in frames if each.count]
        reach_m = max((each.max_added_m for each in frames), default=0.0)
        if not moved:
            return cls(max_added_m=reach_m)
        count = np.array([each.count for each in moved])
        mean_square = np.average([each.rms_m**2 for each in moved], weights=count)
        return cls(
            int(count.sum()),
            float(np.average([each.mean_m for each in moved], weights=count)),
            float(np.sqrt(mean_square)),
            float(np.mean([each.median_m for each in moved])),
            float(np.mean([each.p95_m for each in moved])),
            max(each.max_m for each in moved),
            reach_m,
        )


def added_distance_m(clean: Cloud, cloud: Cloud, change: CloudDifference) -> float:
    """From the farthest added point to its nearest point of the clean cloud; 0 where none was added."""
    points, added = (finite_xyz(each) for each in (clean, cloud[change.added]))
    if not len(added) or not len(points):
        return 0.0
    distance_m, _ = cKDTree(points).query(added)
    return float(np.max(distance_m))


def finite_xyz(cloud: Cloud) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """The coordinates (N, 3) of the points that have some: other sensors mark lost returns by NaN."""
    points = xyz(cloud)
    return points[np.isfinite(points).all(axis=1)]
