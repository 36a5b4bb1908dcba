"""The best of many candidates, kept for each object by what the detector actually finds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


class PerObjectBest:
    """Evaluates candidates for one cloud and keeps the most successful points of each object.

    owner: (N,) the object that each point belongs to, -1 for none. Points (N, 4) are x, y, z, intensity.
    jitter_m: standard deviation of the noise that candidates are evaluated under; 0 for none.
    """

    def __init__(
        self,
        goal: AttackGoal,
        detector: ObjectDetector,
        clean: Float32,
        owner: Int64,
        jitter_m: float,
        rng: np.random.Generator,
    ) -> None:
        self._goal, self._detector, self._owner = goal, detector, owner
        self._jitter_m, self._rng = jitter_m, rng
        self._together, self._success = clean.copy(), np.array(-np.inf)  # of each object
        self._whole, self._whole_success = clean, -np.inf
        self.update(clean)

    def update(self, candidate: Float32) -> Bool:
        """Evaluate a candidate (N, 4); returns the points (N,) for which it is the best so far."""
        seen = jittered(candidate, self._jitter_m, self._rng)
        success = self._goal.success(self._detector.detect(cloud_of(seen)))
        if success.sum() > self._whole_success + 1e-9:
            self._whole, self._whole_success = candidate.copy(), float(success.sum())
        better = success > self._success + 1e-9
        self._success = np.where(better, success, self._success)
        taken: Bool = (self._owner >= 0) & np.append(better, False)[self._owner]
        self._together[taken] = candidate[taken]
        return taken

    def combined(self) -> Float32:
        """The best points (N, 4) for all objects together: one candidate, or the best points of several.

        The combination is evaluated, too, as points from different candidates affect each other.
        """
        self.update(self._together)
        return self._whole.copy()


def jittered(points: Float32, jitter_m: float, rng: np.random.Generator) -> Float32:
    """Points (N, 4) with normal noise of this standard deviation on each coordinate; 0 makes no draw."""
    seen = points.copy()
    if jitter_m:
        seen[:, :3] += rng.normal(0, jitter_m, (len(points), 3)).astype(np.float32)
    return seen


def cloud_of(points: Float32) -> Cloud:
    """Points (N, 4) x, y, z, intensity as a cloud, its other fields zero: no detector reads them."""
    cloud = np.zeros(len(points), POINT_DTYPE)
    for column, name in enumerate(("x", "y", "z", "intensity")):
        cloud[name] = points[:, column]
    return cloud
