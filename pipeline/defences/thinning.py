"""Defences that remove points: randomly, or isolated ones."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

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

    limit_m: float | None = None
    """The largest mean distance that stays; None for that of the given cloud."""

    def __init__(self, *, k: float = 2, sigmas: float = 1.1) -> None:
        if not (k >= 1 and float(k).is_integer()):
            raise UsageError(f"defence outliers: k is {k:g}, but must be a whole number from 1 up")
        if not 0 <= sigmas < math.inf:
            raise UsageError(f"defence outliers: sigmas is {sigmas:g}, but must be finite and 0 or more")
        self.k, self.sigmas = int(k), sigmas

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        finite, mean_m = self._distances_m(cloud)
        if not len(finite):
            return DefendedCloud(cloud)
        limit_m = self._limit_m(mean_m) if self.limit_m is None else self.limit_m
        return DefendedCloud(np.delete(cloud, finite[mean_m > limit_m]))

    def limited_by(self, cloud: Cloud) -> OutlierRemoval:
        """The same defence for parts of a cloud, with the limit that this whole cloud has."""
        finite, mean_m = self._distances_m(cloud)
        other = OutlierRemoval(k=self.k, sigmas=self.sigmas)
        other.limit_m = self._limit_m(mean_m) if len(finite) else None
        return other

    def _limit_m(self, mean_m: npt.NDArray[np.float64]) -> float:
        return float(mean_m.mean() + self.sigmas * mean_m.std(ddof=1))

    def _distances_m(self, cloud: Cloud) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """The finite points (K,), and the mean distance (K,) of each to its neighbours; or none."""
        points = xyz(cloud).astype(np.float64)
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        if len(finite) <= self.k:
            return finite[:0], np.zeros(0)
        from scipy.spatial import cKDTree  # loaded when it is used: shells complete the names of defences

        distance_m, _ = cKDTree(points[finite]).query(points[finite], k=self.k + 1)
        return finite, distance_m[:, 1:].mean(axis=1)  # the nearest one is the point itself
