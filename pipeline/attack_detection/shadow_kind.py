"""Which attack an anomalous shadow shows: a ghost object, or points injected behind a real one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.clusters import density_clusters

Float64 = npt.NDArray[np.float64]

REACH_M, LEAST_POINTS, AT_M = 0.2, 15, 8.0
"""Of a cluster in a shadow that begins at this distance, behind an object right ahead; farther away, rays lie
farther apart, and the reach grows with the distance."""

RIDGE = 1e-3
"""Added to the variance of each feature, so that it has an inverse."""


def shadow_features(points: Float64) -> Float64:
    """What tells shadows apart: the number of clusters of the returns (N, 3) in one, and how many returns a
    cluster has on average; both as ln(1 + value), (2,)."""
    first_m = float(np.hypot(points[:, 0], points[:, 1]).min(initial=np.inf))
    labels = density_clusters(points, REACH_M * first_m / AT_M, LEAST_POINTS)
    clusters, members = int(labels.max(initial=-1)) + 1, int((labels >= 0).sum())
    features: Float64 = np.log1p(np.array([clusters, members / max(clusters, 1)]))
    return features


@dataclass(frozen=True)
class ShadowKind:
    """A linear discriminant (Fisher 1936) on the features of shadows: from 0 on it is a ghost's."""

    weights: Float64
    offset: float

    @classmethod
    def fitted(cls, ghosts: Sequence[Float64], invalidated: Sequence[Float64]) -> ShadowKind:
        """From the features (2,) of anomalous shadows of both kinds; with one kind alone, all are ghosts."""
        if not (ghosts and invalidated):
            return cls(np.zeros(2), 1.0)
        parts = [np.stack(ghosts), np.stack(invalidated)]
        means = [part.mean(axis=0) for part in parts]
        centred = np.concatenate([part - mean for part, mean in zip(parts, means, strict=True)])
        spread = centred.T @ centred / len(centred) + RIDGE * np.eye(2)
        weights = np.linalg.solve(spread, means[0] - means[1])
        return cls(weights, -float(weights @ (means[0] + means[1]) / 2))

    def is_ghost(self, features: Float64) -> bool:
        """Whether a shadow of these features (2,) is of an object that is not there."""
        return bool(features @ self.weights + self.offset >= 0)
