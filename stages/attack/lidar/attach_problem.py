"""The allocation problem of `attach`: which places near each object get a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.addition_problem import AdditionProblem
from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.detector.protocol import VoxelDetector

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class AttachProblem(AdditionProblem):
    """It proposes the places where a point raises the loss the most, by the gradient.

    decay_m: a place d away from its clean point counts exp(-(d / decay_m)**2).
    """

    decay_m: float

    def gains(self, taken: Int64, pool: Int64) -> Float64:
        """The estimated gain (K,) of a point at each place of the pool, beside those taken."""
        points = torch.from_numpy(self.with_added(taken))
        if isinstance(self.objective.detector, VoxelDetector):
            gain = self._occupancy_gains(self.objective.detector, points, pool)
        else:
            gain = self._copy_gains(points, pool)
        if not gain.any():
            raise NoGradientError
        return gain * np.exp(-((self.places.distance_m[pool] / self.decay_m) ** 2))

    def _occupancy_gains(self, detector: VoxelDetector, points: torch.Tensor, pool: Int64) -> Float64:
        """The gradient of the loss with respect to the occupancy of each place's voxel."""
        goal, probes = self.objective.goal, torch.from_numpy(self.places.points[pool])
        targets = goal.loss_targets
        loss, occupancy, row = detector.occupancy_loss(points, targets.boxes, targets.labels, probes)
        (gradient,) = gradients_of(loss, occupancy)
        of_row = np.nan_to_num(goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        mine = row.cpu().numpy()[len(points) :]
        return np.where(mine >= 0, of_row[mine], 0.0)

    def _copy_gains(self, points: torch.Tensor, pool: Int64) -> Float64:
        """First-order gain by the loss alone: a copy of the place's clean point, moved to the place."""
        goal, leaf = self.objective.goal, points.requires_grad_()
        loss = self.objective.detector.loss(leaf, goal.loss_targets.boxes, goal.loss_targets.labels)
        (gradient,) = gradients_of(loss, leaf)
        slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
        source = self.places.source[pool]
        way_m = self.places.points[pool, :3].astype(np.float64) - self.clean[source, :3]
        gain: Float64 = goal.sign * (slope[source] * way_m).sum(axis=1)
        return gain
