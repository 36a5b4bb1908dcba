"""Which points may lie in the shadow of which boxes, so that few shadow rays are cast at each road user."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.long_rows import along, chosen_columns
from advpipe.pipeline.sensors.camera.rectangle_map import RectangleMap

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]


class SunShadows:
    """Where boxes cast their shadows, across the direction (3,) to the sun.

    map_SE3_box: (B, 4, 4), the frame at each box's centre. half_m: (B, 3), half of each side.
    """

    def __init__(self, map_SE3_box: Float64, half_m: Float64, sun: Float32) -> None:
        towards = np.asarray(sun, np.float64)
        across = np.cross(towards, [0.0, 0.0, 1.0] if abs(towards[2]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        self._axes = np.stack([across, np.cross(towards, across), towards])
        # Near the boxes, so that single precision suffices.
        self._origin_m = map_SE3_box[:1, :3, 3].sum(axis=0)
        centre_m = (map_SE3_box[:, :3, 3] - self._origin_m) @ self._axes.T
        half_m = np.einsum("bij,bj->bi", np.abs(self._axes @ map_SE3_box[:, :3, :3]), half_m) + 0.01
        low_m, high_m = centre_m - half_m, centre_m + half_m
        self._map = RectangleMap(low_m[:, :2], high_m[:, :2])
        self._low_m, self._high_m = low_m.T.astype(np.float32), high_m.T.astype(np.float32)

    def pairs(self, points_m: Float32) -> tuple[Int64, Int64]:
        """Indices (K,) of points (3, N) and of boxes that may shade them, a superset of those that do."""
        away_m = points_m - self._origin_m.astype(np.float32)[:, None]
        first_m, second_m = (along(axis, away_m) for axis in self._axes[:2])
        points, boxes = self._map.pairs(first_m, second_m)
        third_m = along(self._axes[2], chosen_columns(away_m, points))
        inside = third_m <= np.take(self._high_m[2], boxes)
        for low_m, high_m, place_m in zip(self._low_m, self._high_m, (first_m, second_m), strict=False):
            place_m = np.take(place_m, points)
            inside &= (place_m >= np.take(low_m, boxes)) & (place_m <= np.take(high_m, boxes))
        chosen = np.flatnonzero(inside)
        return np.take(points, chosen), np.take(boxes, chosen)
