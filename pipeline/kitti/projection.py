"""The rectangle of an image in which a 3D box appears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import Float64

NEAREST_M = 0.1
"""Depth at which a box that reaches behind the camera is cut."""

_EDGES = [(i, (i + 1) % 4) for i in range(4)]
_EDGES += [(i + 4, j + 4) for i, j in _EDGES] + [(i, i + 4) for i in range(4)]
"""Pairs of `box_corners` that an edge joins."""


@dataclass(frozen=True)
class ImageRectangle:
    """edges_px: left, top, right, bottom inside the image. truncation: share of the whole outside it."""

    edges_px: tuple[float, float, float, float]
    truncation: float


def project_box(image_P_lidar: Float64, box: Float64, width_px: int, height_px: int) -> ImageRectangle | None:
    """Where a box (7,) appears in an image; None for one that is behind the camera or beside the image.

    image_P_lidar: projection (3, 4) to homogeneous pixels, whose third row is the depth.
    """
    corners = box_corners(box)[0]
    image = np.column_stack([corners, np.ones(8)]) @ image_P_lidar.T
    points = [*image[image[:, 2] >= NEAREST_M], *_cuts(image)]
    if not points:
        return None
    pixels = np.array([point[:2] / point[2] for point in points])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    limit = np.array([width_px - 1.0, height_px - 1.0])
    inside_low, inside_high = np.clip(low, 0, limit), np.clip(high, 0, limit)
    inside, whole = np.prod(inside_high - inside_low), np.prod(high - low)
    if inside <= 0:
        return None
    left, top, right, bottom = map(float, (*inside_low, *inside_high))
    return ImageRectangle((left, top, right, bottom), float(1 - inside / whole))


def _cuts(image: Float64) -> list[Float64]:
    """Where the edges between corners (8, 3) in homogeneous pixels pass `NEAREST_M`."""
    cuts = []
    for a, b in _EDGES:
        one, other = image[a], image[b]
        if (one[2] < NEAREST_M) != (other[2] < NEAREST_M):
            share = (NEAREST_M - one[2]) / (other[2] - one[2])
            cuts.append(one + share * (other - one))
    return cuts
