"""The allocation problem of `attach` in expectation over transformations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.expected_objective import ExpectedObjective
from advpipe.pipeline.detector.protocol import VoxelDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi
from advpipe.stages.attack.lidar.attach_problem import AttachProblem, addition_gains

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(eq=False)
class RobustAttachProblem(AttachProblem):
    """It proposes places by their mean gain under all transformations, and judges by the mean objective.

    A place whose voxel is occupied under a transformation gains nothing there.
    """

    objective: ExpectedObjective

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        is_there = np.arange(len(self._all)) < len(self.clean)
        is_there[len(self.clean) + taken] = True
        points = self._all[self.focus.shown[is_there[self.focus.shown]]]
        if not will_propose:
            return self.objective(points)
        self.refill_pool(taken)
        goal, detector = self.objective.goal, self.objective.detector
        assert isinstance(detector, VoxelDetector)
        probes = self.places.points[self._pool]
        views = self.objective.views(points)
        seen = [addition_gains(goal, detector, points, probes, view) for view in views]
        found = [
            detector.detect(cloud_of_xyzi(view.points)) if each is None else each
            for (each, _), view in zip(seen, views, strict=True)
        ]
        weights = self.objective.weights(found, views)[:, self.places.owner[self._pool]]
        gain = (weights * [of_view for _, of_view in seen]).mean(axis=0)
        gain *= np.exp(-((self.places.distance_m[self._pool] / self.decay_m) ** 2))
        before, momentum = self._gain[self._pool], self.objective.expectation.momentum
        before = np.where(np.isfinite(before), before, gain)  # of new places
        self._gain[self._pool] = momentum * before + (1 - momentum) * gain
        return self.objective.expected(found, views)
