"""How much of the sky the ground beside and below road users faces: they seem to float without it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.long_rows import chosen_columns

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

REACH_M = 0.9
NEAR_M = 30.0
DEEPEST = np.float32(0.82)
FADE_M = np.float32(0.3)
CELL_M = 0.5


def openness(boxes: Float64, points_m: Float32, level: Int64, camera_m: Float64) -> Float32:
    """Share of the sky (K,) that points (3, K) face beside the boxes (M, 7), all in the map frame.

    level: indices of the points that boxes may darken. camera_m: (3,), only boxes near it are looked at.
    """
    share = np.ones(points_m.shape[1], np.float32)
    near = boxes[np.linalg.norm(boxes[:, :2] - camera_m[:2], axis=1) < NEAR_M]
    if not len(near) or not len(level):
        return share
    half_m = np.hypot(near[:, 3], near[:, 4])[:, None] / 2 + REACH_M
    low_m, high_m = near[:, :2] - half_m, near[:, :2] + half_m
    beside = _in_squares(chosen_columns(points_m[:2], level), low_m, high_m)
    chosen = level[beside]
    places = chosen_columns(points_m, chosen)
    for box, low, high in zip(near, low_m.astype(np.float32), high_m.astype(np.float32), strict=True):
        x, y = places[0], places[1]
        around = np.flatnonzero((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))
        factor = _share_beside(box, chosen_columns(places, around))
        share[chosen[around]] *= factor
    return share


def _in_squares(points_m: Float32, low_m: Float64, high_m: Float64) -> Int64:
    """Indices of the points (2, N) in or near one of the squares (M, 2), by a coarse map of them."""
    origin = low_m.min(axis=0)
    first = np.floor((low_m - origin) / CELL_M).astype(np.int64) + 1  # around the map is an empty margin
    last = np.floor((high_m - origin) / CELL_M).astype(np.int64) + 1
    columns, rows = (last.max(axis=0) + 2).tolist()
    covered = np.zeros((columns, rows), np.bool_)
    for start, end in zip(first, last, strict=True):
        covered[start[0] : end[0] + 1, start[1] : end[1] + 1] = True
    cells = []
    for axis, size in enumerate((columns, rows)):
        place = points_m[axis] - np.float32(origin[axis])
        place *= np.float32(1 / CELL_M)
        place += np.float32(1)
        np.clip(place, 0, np.float32(size - 1), out=place)
        cells.append(place.astype(np.int32))
    cells[0] *= np.int32(rows)
    cells[0] += cells[1]
    return np.flatnonzero(np.take(covered.ravel(), cells[0], mode="clip"))


def _share_beside(box: Float64, points_m: Float32) -> Float32:
    """The share (N,) that points (3, N) face beside one box."""
    x, y = points_m[0] - np.float32(box[0]), points_m[1] - np.float32(box[1])
    cos, sin = np.float32(np.cos(box[6])), np.float32(np.sin(box[6]))
    ahead = np.maximum(np.abs(x * cos + y * sin) - np.float32(box[3] / 2 - 0.15), 0)
    aside = np.maximum(np.abs(y * cos - x * sin) - np.float32(box[4] / 2 - 0.1), 0)
    above = np.abs(points_m[2] - np.float32(box[2] - box[5] / 2))
    away = np.sqrt(ahead * ahead + aside * aside)
    factor = 1 - DEEPEST * np.exp(-away / FADE_M)
    shares: Float32 = np.where(
        (above < np.float32(0.6)) & (away < np.float32(REACH_M)), factor, np.float32(1)
    )
    return shares
