"""The allocation problem of `detach` in expectation over transformations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.expectation import View
from advpipe.pipeline.adversary.expected_objective import ExpectedObjective
from advpipe.pipeline.detector.protocol import Detections, VoxelDetector
from advpipe.stages.attack.lidar.detach_problem import DetachProblem, removal_gains

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(eq=False)
class RobustDetachProblem(DetachProblem):
    """It proposes points by their mean gain under all transformations, and judges by the mean objective.

    The points of a voxel of the given cloud go together: what is left of one holds the next grid's voxel.
    """

    objective: ExpectedObjective

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        left = np.setdiff1d(self.focus.shown, taken, assume_unique=True)
        views = self.objective.views(self.points[left])
        if not will_propose:
            return self.objective.expected([self._detected(view) for view in views], views)
        goal, detector = self.objective.goal, self.objective.detector
        assert isinstance(detector, VoxelDetector)
        seen = [removal_gains(goal, detector, self.points[left], view) for view in views]
        found = [
            self._detected(view) if each is None else each
            for (each, _, _), view in zip(seen, views, strict=True)
        ]
        before, weights = self._gain.copy(), self.objective.weights(found, views)
        momentum = self.objective.expectation.momentum if before.any() else 0.0
        self._gain[:] = 0
        for view, (_, gain, _), weight in zip(views, seen, weights, strict=True):
            shown = left[view.source]
            self._gain[shown] += gain * np.append(weight, 0.0)[self.owner[shown]]
        self._gain[left] = momentum * before[left] + (1 - momentum) * self._gain[left]
        self._group[left] = seen[0][2]  # the first view is of the points as they are
        return self.objective.expected(found, views)

    def _detected(self, view: View) -> Detections:
        return super().detected(view.points, view.source, False)

    def gains(self, left: Int64) -> tuple[Float64, Int64]:
        """The gains, each the mean over its group, so that groups stay together in their order."""
        gain, group = super().gains(left)
        _, place = np.unique(group, return_inverse=True)
        mean = np.bincount(place, gain) / np.bincount(place)
        return mean[place], group
