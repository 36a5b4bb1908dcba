"""Defences that remove points: randomly, or isolated ones."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.defences.base import DefendedCloud
from advpipe.pipeline.messages.cloud import Cloud, xyz


class RandomSampling:
    """Simple random sampling: removes exactly round(drop * N) of a cloud's N points, uniformly."""

    is_default: ClassVar[bool] = True

    def __init__(self, *, drop: float = 0.05) -> None:
        if not 0 < drop < 1:
            raise UsageError(f"defence sample: drop is {drop:g}, but must lie between 0 and 1, such as 0.05")
        self.drop = drop

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        gone = rng.choice(len(cloud), size=math.floor(self.drop * len(cloud) + 0.5), replace=False)
        return DefendedCloud(np.delete(cloud, gone))


class OutlierRemoval:
    """Statistical outlier removal (Rusu et al. 2008): removes points far from their neighbours.

    A point is removed if its mean distance to its k nearest neighbours exceeds the mean of these means over
    the cloud by more than `sigmas` of their standard deviation (k 2 and 1.1, as in DUP-Net, ICCV 2019).
    Points that are not finite are kept. The neighbours come from a k-d tree.
    """

    is_default: ClassVar[bool] = True

    def __init__(self, *, k: float = 2, sigmas: float = 1.1) -> None:
        if not (k >= 1 and float(k).is_integer()):
            raise UsageError(f"defence outliers: k is {k:g}, but must be a whole number from 1 up")
        if not 0 <= sigmas < math.inf:
            raise UsageError(f"defence outliers: sigmas is {sigmas:g}, but must be finite and 0 or more")
        self.k, self.sigmas = int(k), sigmas

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        points = xyz(cloud).astype(np.float64)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        if len(finite) <= self.k:
            return DefendedCloud(cloud)
        from scipy.spatial import cKDTree  # loaded when it is used: shells complete the names of defences

        distance_m, _ = cKDTree(points[finite]).query(points[finite], k=self.k + 1)
        mean_m = distance_m[:, 1:].mean(axis=1)  # the nearest one is the point itself
        limit_m = mean_m.mean() + self.sigmas * mean_m.std(ddof=1)
        return DefendedCloud(np.delete(cloud, finite[mean_m > limit_m]))
