"""How much of the sky the ground beside and below road users faces: they seem to float without it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.pipeline.sensors.camera.lens import Lens

Float32 = npt.NDArray[np.float32]

REACH_M = 0.9
NEAR_M = 30.0
DEEPEST = np.float32(0.82)
FADE_M = np.float32(0.3)


def openness(
    boxes: Float64,
    points_m: Float32,
    is_ground: npt.NDArray[np.bool_],
    lens: Lens,
    map_SE3_optical: Float64,
    top: int = 0,
) -> Float32:
    """Share of the sky (H, W) that each place faces beside the boxes (M, 7) in the map frame.

    points_m: (3, H, W), the places that the pixels of a band of rows see. is_ground: (H, W), whether they can
    be darkened. top: the band's first row.
    """
    height, width = is_ground.shape
    share = np.ones((height, width), np.float32)
    grounded = np.flatnonzero(is_ground.any(axis=1))
    near = boxes[np.linalg.norm(boxes[:, :2] - map_SE3_optical[:2, 3], axis=1) < NEAR_M]
    if not len(grounded) or not len(near):
        return share
    wide = near + (0, 0, 0, 2 * REACH_M, 2 * REACH_M, 0, 0)
    corners = transform_points(invert(map_SE3_optical), box_corners(wide)[:, :4].reshape(-1, 3))
    pixels = lens.project(corners).reshape(-1, 4, 2) - (0, top)
    ahead = corners[:, 2].reshape(-1, 4) > 0.3
    is_whole = np.asarray(ahead.all(axis=1) & np.isfinite(pixels).all(axis=(1, 2)))
    lowest = slice(int(grounded[0]), int(grounded[-1]) + 1)
    some = ahead.any(axis=1)
    for box, place, whole in zip(near[some], pixels[some], is_whole[some], strict=True):
        rows, columns = lowest, slice(0, width)
        if whole:
            low = np.clip(np.floor(place.min(axis=0)), 0, (width, height)).astype(int)
            high = np.clip(np.ceil(place.max(axis=0)) + 1, 0, (width, height)).astype(int)
            rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
        if rows.start < rows.stop and columns.start < columns.stop:
            _darken(share[rows, columns], points_m[:, rows, columns], is_ground[rows, columns], box)
    return share


def _darken(
    share: Float32, points_m: Float32, is_ground: npt.NDArray[np.bool_], box: npt.NDArray[np.float64]
) -> None:
    x, y = points_m[0] - np.float32(box[0]), points_m[1] - np.float32(box[1])
    cos, sin = np.float32(np.cos(box[6])), np.float32(np.sin(box[6]))
    ahead = np.maximum(np.abs(x * cos + y * sin) - np.float32(box[3] / 2 - 0.15), 0)
    aside = np.maximum(np.abs(y * cos - x * sin) - np.float32(box[4] / 2 - 0.1), 0)
    above = np.abs(points_m[2] - np.float32(box[2] - box[5] / 2))
    away = np.sqrt(ahead * ahead + aside * aside)
    factor = 1 - DEEPEST * np.exp(-away / FADE_M)
    np.multiply(share, factor, out=share, where=is_ground & (above < 0.6) & (away < REACH_M))
