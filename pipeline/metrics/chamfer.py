"""The Chamfer distance between two clouds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from advpipe.pipeline.core.errors import AdvpipeError

Float64 = npt.NDArray[np.float64]


def chamfer_distance(points: npt.ArrayLike, other: npt.ArrayLike, workers: int = 1) -> float:
    """Chamfer distance in m² between points (N, 3) and (M, 3): Eq. 4 of the paper.

    It is the sum, over both directions, of the mean squared distance to the nearest point of the other cloud.
    Points that are in both clouds have the distance 0 and are not searched for. The result does not depend on
    `workers`, the number of threads. Raises AdvpipeError for a cloud without points or with one that is not
    finite.
    """
    a, b = _checked(points, "first"), _checked(other, "second")
    return _mean_squared_nearest(a, b, workers) + _mean_squared_nearest(b, a, workers)


def _checked(points: npt.ArrayLike, which: str) -> Float64:
    array = np.asarray(points, dtype=np.float64)
    if len(array) == 0:
        raise AdvpipeError(f"the {which} cloud of a Chamfer distance has no points")
    if not np.isfinite(array).all():
        raise AdvpipeError(f"the {which} cloud of a Chamfer distance has a point that is not finite")
    return np.ascontiguousarray(array)


def _mean_squared_nearest(a: Float64, b: Float64, workers: int) -> float:
    """The mean over a of the squared distance to the nearest point of b."""
    # Clouds of the same length usually differ by displaced points: the same point is in the same row.
    same = (a == b).all(axis=1) if len(a) == len(b) else _is_in(a, b)
    new = a[~same]
    if not len(new):
        return 0.0
    # Consecutive queries for neighbours visit the same part of the tree, which is three times as fast.
    new = new[_tree(new).indices]
    _, nearest = _tree(b).query(new, workers=workers)
    return float(np.square(new - b[nearest]).sum() / len(a))


def _tree(points: Float64) -> cKDTree:
    """A k-d tree that is quick to build."""
    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def _is_in(a: Float64, b: Float64) -> npt.NDArray[np.bool_]:
    """Which points of a (N, 3) are certainly in b: (N,). A collision of keys may hide one."""
    key_a, key_b = _key(a), _key(b)
    order = np.argsort(key_b, kind="stable")
    index = np.minimum(np.searchsorted(key_b[order], key_a), len(b) - 1)
    same: npt.NDArray[np.bool_] = (b[order[index]] == a).all(axis=1)
    return same


def _key(points: Float64) -> npt.NDArray[np.uint64]:
    """A 64-bit hash (N,) of each point's coordinates (N, 3)."""
    bits = points.view(np.uint64)
    key = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for column in (1, 2):
        key = (key ^ (key >> np.uint64(29)) ^ bits[:, column]) * np.uint64(0xBF58476D1CE4E5B9)
    mixed: npt.NDArray[np.uint64] = key ^ (key >> np.uint64(32))
    return mixed
