"""How much of the sky the ground beside and below road users faces: they seem to float without it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.pipeline.sensors.camera.lens import Lens

Float32 = npt.NDArray[np.float32]

REACH_M = 0.9
NEAR_M = 35.0
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
    wide = boxes.copy()
    wide[:, 3:5] += 2 * REACH_M
    near = np.linalg.norm(wide[:, :2] - map_SE3_optical[:2, 3], axis=1) < NEAR_M
    optical_SE3_map = invert(map_SE3_optical)
    grounded = np.flatnonzero(is_ground.any(axis=1))
    lowest = slice(int(grounded[0]), height) if len(grounded) else slice(0, 0)
    for box, corners in zip(boxes[near], box_corners(wide[near]), strict=True):
        pixels = lens.project(transform_points(optical_SE3_map, corners[:4]))
        ahead = transform_points(optical_SE3_map, corners[:4])[:, 2] > 0.3
        if not ahead.any():
            continue
        rows, columns = lowest, slice(0, width)
        if np.isfinite(pixels).all() and ahead.all():
            low = np.clip(np.floor(pixels.min(axis=0)) - (0, top), 0, (width, height)).astype(int)
            high = np.clip(np.ceil(pixels.max(axis=0)) + (1, 1 - top), 0, (width, height)).astype(int)
            rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
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
