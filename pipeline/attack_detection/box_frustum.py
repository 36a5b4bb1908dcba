"""The returns whose rays meet a box: before it, in it and behind it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class BoxFrustum:
    """The K returns of a cloud whose rays from the sensor meet a box.

    unit: (K, 3) directions and origin: (3,) the sensor, in the frame of the box. near_m, far_m: (K,) where
    each ray enters and leaves the box. range_m: (K,) where it returns. half_m: (3,) half the box's size.
    """

    unit: Float64
    origin: Float64
    near_m: Float64
    far_m: Float64
    range_m: Float64
    half_m: Float64

    @property
    def penetration(self) -> float:
        """The share of the returns that lie behind the box; 0 without any."""
        return float((self.range_m > self.far_m).mean()) if len(self.range_m) else 0.0


def box_frustums(points: Float64, boxes: Float64) -> Iterator[BoxFrustum]:
    """The frustum of each box (M, 7) in points (N, 3) of the sensor, all finite and none at its origin."""
    range_m = np.linalg.norm(points, axis=1)
    unit = points / range_m[:, None]
    for box in boxes:
        half_m = box[3:6] / 2
        distance_m, radius_m = np.linalg.norm(box[:3]), np.linalg.norm(half_m)
        least = np.sqrt(1 - (radius_m / distance_m) ** 2) if distance_m > radius_m else -1.0
        about = np.flatnonzero(unit @ box[:3] >= least * distance_m)
        cos, sin = np.cos(box[6]), np.sin(box[6])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        ray, origin = unit[about] @ turn, -box[:3] @ turn
        ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
        one, other = (-half_m - origin) / ray, (half_m - origin) / ray
        near_m = np.maximum(np.minimum(one, other).max(axis=1), 0.0)
        far_m = np.maximum(one, other).min(axis=1)
        meets = np.flatnonzero(near_m <= far_m)
        yield BoxFrustum(ray[meets], origin, near_m[meets], far_m[meets], range_m[about[meets]], half_m)
