"""Clusters of points by density: DBSCAN (Ester et al. 1996)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


def density_clusters(points: Float64, reach_m: float, least: int) -> Int64:
    """The cluster (N,) of each point (N, 3), numbered from 0; -1 for noise.

    A point with `least` points within the reach, itself included, is a core; cores in reach of each other
    share a cluster, and a point in reach of a core belongs to that of the core nearest to it.
    """
    labels = np.full(len(points), -1, np.int64)
    if not len(points):
        return labels
    tree = cKDTree(points)
    first, second = tree.query_pairs(reach_m, output_type="ndarray").T
    neighbours = 1 + np.bincount(first, minlength=len(points)) + np.bincount(second, minlength=len(points))
    is_core = neighbours >= least
    if not is_core.any():
        return labels
    joined = is_core[first] & is_core[second]
    links = coo_matrix(
        (np.ones(int(joined.sum()), bool), (first[joined], second[joined])), shape=(len(points),) * 2
    )
    _, component = connected_components(links, directed=False)
    _, labels[is_core] = np.unique(component[is_core], return_inverse=True)
    cores, rest = np.flatnonzero(is_core), np.flatnonzero(~is_core)
    away_m, nearest = cKDTree(points[cores]).query(points[rest])
    labels[rest] = np.where(away_m <= reach_m, labels[cores][nearest], -1)
    return labels
