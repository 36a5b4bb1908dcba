"""The best of many attempts, kept for each object by what the detector really finds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud
from advpipe.stages.attack.lidar.goal import Goal

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


class PerObjectBest:
    """Shown attempts at one cloud, it keeps for each object the points that hurt it most.

    owner: (N,) the object that each point belongs to, -1 for none. Points (N, 4) are x, y, z, intensity.
    jitter_m: standard deviation of the noise that an attack must survive; 0 for none.
    """

    def __init__(
        self,
        goal: Goal,
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
        self.show(clean)

    def show(self, attempt: Float32) -> Bool:
        """Judge an attempt (N, 4); for which points (N,) it is now the one that is kept."""
        seen = jittered(attempt, self._jitter_m, self._rng)
        success = self._goal.success(self._detector.detect(cloud_of(seen)))
        if success.sum() > self._whole_success + 1e-9:
            self._whole, self._whole_success = attempt.copy(), float(success.sum())
        better = success > self._success + 1e-9
        self._success = np.where(better, success, self._success)
        taken: Bool = (self._owner >= 0) & np.append(better, False)[self._owner]
        self._together[taken] = attempt[taken]
        return taken

    def settle(self) -> Float32:
        """The best points (N, 4) for all objects together: one attempt, or what was kept of several.

        Looked at once more, for neighbours that were kept from different attempts change each other.
        """
        self.show(self._together)
        return self._whole.copy()


def jittered(points: Float32, jitter_m: float, rng: np.random.Generator) -> Float32:
    """Points (N, 4) with noise of this standard deviation on each coordinate; without a draw for 0."""
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
