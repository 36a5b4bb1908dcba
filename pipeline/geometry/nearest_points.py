"""The nearest of many points to each of a few."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import near_circles

Float64 = npt.NDArray[np.float64]
Points = npt.NDArray[np.floating[Any]]

WORTH_A_CHOICE = 5_000
"""Fewer points are all put into the tree."""


def nearest_points(
    points: Points, wanted: Points, about_m: float | None = 1.0
) -> tuple[Float64, npt.NDArray[np.int64]]:
    """The distance (K,) of each of some places (K, 3) to the nearest of points (N, 3), all finite, and its
    index; infinite, and N, without points.

    about_m: how near it probably lies. Most of the time goes into building a tree, so it is built of what
    lies so near to any of the places in the x-y plane; all is searched for places with nothing so near, or
    where it is None.
    """
    if about_m is None or len(points) < WORTH_A_CHOICE or len(wanted) > len(points) // 10:
        return _searched(points, wanted)
    near = near_circles(points, np.asarray(wanted[:, :2], np.float64), np.full(len(wanted), about_m))
    distance, index = _searched(points[near], wanted)
    index = np.append(near, len(points))[index]
    far = np.flatnonzero(~(distance <= about_m))
    if len(far):
        distance[far], index[far] = _searched(points, wanted[far])
    return distance, index


def _searched(points: Points, wanted: Points) -> tuple[Float64, npt.NDArray[np.int64]]:
    from scipy.spatial import cKDTree

    if not len(points) or not len(wanted):
        return np.full(len(wanted), np.inf), np.full(len(wanted), len(points), np.int64)
    tree = cKDTree(np.asarray(points, np.float64), balanced_tree=False, compact_nodes=False)
    distance, index = tree.query(np.asarray(wanted, np.float64))
    return distance, index
