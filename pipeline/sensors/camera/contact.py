"""How much of the sky the ground beside and below road users faces: they seem to float without it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.long_rows import chosen_columns
from advpipe.pipeline.sensors.camera.rectangle_map import RectangleMap

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

REACH_M = 0.9
NEAR_M = 30.0
DEEPEST = np.float32(0.82)
FADE_M = np.float32(0.3)
HIGHEST_M = np.float32(0.6)


class ContactShadows:
    """The boxes (M, 7) that are near a camera at (3,), and a map of the places beside them.

    All in the map frame. All parts of a picture share it, and look at all boxes at once: few long sums take
    less time than many short ones.
    """

    def __init__(self, boxes: Float64, camera_m: Float64) -> None:
        near = boxes[np.linalg.norm(boxes[:, :2] - camera_m[:2], axis=1) < NEAR_M]
        x, y, z, length, width, height, yaw = near.T
        columns = x, y, np.cos(yaw), np.sin(yaw), length / 2 - 0.15, width / 2 - 0.1, z - height / 2
        self._columns: Float32 = np.stack(columns).astype(np.float32)
        half_m = np.hypot(length, width)[:, None] / 2 + REACH_M
        self._map = RectangleMap(near[:, :2] - half_m, near[:, :2] + half_m)

    def openness(self, points_m: Float32, level: Int64) -> Float32:
        """Share of the sky (K,) that points (3, K) face beside the boxes.

        level: indices of the points that boxes may darken.
        """
        share = np.ones(points_m.shape[1], np.float32)
        if not len(self._map) or not len(level):
            return share
        points, boxes = self._map.pairs(*chosen_columns(points_m[:2], level))
        points = np.take(level, points)
        away_m, above_m = self._distances(chosen_columns(points_m, points), boxes)
        darker = np.flatnonzero((above_m < HIGHEST_M) & (away_m < np.float32(REACH_M)))
        factor = 1 - DEEPEST * np.exp(-np.take(away_m, darker) / FADE_M)
        np.multiply.at(share, np.take(points, darker), factor)
        return share

    def _distances(self, points_m: Float32, boxes: Int64) -> tuple[Float32, Float32]:
        """How far points (3, N) are from the outlines of boxes (N,), and above or below their floors."""
        box_x, box_y, cos, sin, half_length, half_width, floor = chosen_columns(self._columns, boxes)
        x, y = points_m[0] - box_x, points_m[1] - box_y
        ahead = np.maximum(np.abs(x * cos + y * sin) - half_length, 0)
        aside = np.maximum(np.abs(y * cos - x * sin) - half_width, 0)
        return np.sqrt(ahead * ahead + aside * aside), np.abs(points_m[2] - floor)
