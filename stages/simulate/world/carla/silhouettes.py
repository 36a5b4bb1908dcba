"""The extents of road users in CARLA's images, and of what would be seen of them if nothing were before them.

CARLA tells what each pixel shows, and how far away that is, but not what it would show without that: a body's
hidden part is estimated from its 3D box.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes, box_corners
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.pipeline.sensors.camera.picture import extents
from advpipe.stages.simulate.world.carla.boxes import entry_m

Int64 = npt.NDArray[np.int64]

AHEAD_M = 0.1
"""A box with a corner nearer than this to the plane of the camera may be anywhere in the image."""

BEFORE_M = 0.05
"""What is nearer than a box by this hides it."""


def silhouettes(
    size_px: tuple[int, int],
    rays: Float64,
    range_m: npt.NDArray[np.float32],
    objects: npt.NDArray[np.int32],
    boxes: Boxes,
    map_SE3_optical: Float64,
) -> tuple[Int64, Int64, Int64, Int64]:
    """`visible`, `alone`, `visible_px` and `alone_px` of `Layers`, for boxes in the map frame.

    rays: (P, 3), directions of the pixels in the optical frame, row by row. range_m, objects: (P,), of what
    they show. The rays through a road user's box that meet something else before it are its hidden pixels,
    and hide as large a share of the body as of the box. Its whole extents are those of the box where
    something hides it, and else those of its pixels.
    """
    width = size_px[0]
    own = np.flatnonzero(objects >= 0)
    visible, visible_px = extents(own, objects[own].astype(np.int64), len(boxes), width)
    alone, alone_px = visible.copy(), visible_px.copy()
    for index, box in enumerate(boxes.geometry):
        pixels = _pixels_near(box, size_px, rays, map_SE3_optical)
        enter_m = entry_m(map_SE3_optical[:3, 3], rays[pixels] @ map_SE3_optical[:3, :3].T, box)
        through = np.isfinite(enter_m)
        hidden = through & (range_m[pixels] < enter_m - BEFORE_M) & (objects[pixels] != index)
        count, blocked = int(through.sum()), int(hidden.sum())
        if not blocked:
            continue
        whole = round(visible[index] * count / max(count - blocked, 1))
        alone[index] = max(visible[index], min(whole, count)) if visible[index] else blocked
        inside = np.concatenate([pixels[through], own[objects[own] == index]])
        _, edges = extents(inside, np.zeros(len(inside), np.int64), 1, width)
        alone_px[index] = edges[0]
    return visible, alone, visible_px, alone_px


def _pixels_near(box: Float64, size_px: tuple[int, int], rays: Float64, map_SE3_optical: Float64) -> Int64:
    """The pixels (K,) whose rays may meet a box."""
    width, height = size_px
    corners = transform_points(invert(map_SE3_optical), box_corners(box)[0])
    if corners[:, 2].max() < AHEAD_M:
        return np.zeros(0, np.int64)
    if corners[:, 2].min() < AHEAD_M:
        return np.arange(width * height)
    slopes = corners[:, :2] / corners[:, 2:]
    first, last = (ray[:2] / ray[2] for ray in (rays[0], rays[-1]))
    size = np.array([width, height])
    low = (slopes.min(axis=0) - first) / (last - first) * (size - 1)
    high = (slopes.max(axis=0) - first) / (last - first) * (size - 1)
    left, top = np.clip(np.floor(low), 0, size).astype(int)
    right, bottom = np.clip(np.ceil(high) + 1, 0, size).astype(int)
    rows, columns = np.arange(top, bottom), np.arange(left, right)
    return (rows[:, None] * width + columns).ravel()
