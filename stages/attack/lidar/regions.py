"""Which object a point belongs to."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import points_in_boxes


def region_of(
    points: npt.NDArray[np.floating[Any]], boxes: npt.NDArray[np.floating[Any]], margin_m: float
) -> npt.NDArray[np.int64]:
    """The box (of M, 7) that each point (N, 3) lies in or nearest to, up to `margin_m` away; -1 for none."""
    region = np.full(len(points), -1, np.int64)
    nearest_m = np.full(len(points), np.inf)
    for number, inside in enumerate(points_in_boxes(points, boxes, margin_m)):
        distance_m = _outside_m(np.asarray(points[inside], np.float64), np.asarray(boxes[number], np.float64))
        closer = distance_m < nearest_m[inside]
        region[inside[closer]], nearest_m[inside[closer]] = number, distance_m[closer]
    return region


def _outside_m(points: npt.NDArray[np.float64], box: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """How far points (K, 3) lie from a box (7,); inside, how deep, as a negative number."""
    dx, dy, dz = (points - box[:3]).T
    c, s = np.cos(box[6]), np.sin(box[6])
    local = np.abs(np.stack([dx * c + dy * s, dy * c - dx * s, dz], axis=1)) - box[3:6] / 2
    outside: npt.NDArray[np.float64] = np.linalg.norm(np.maximum(local, 0), axis=1)
    return np.where(outside > 0, outside, local.max(axis=1))
