"""The allocation problem of `detach`: which voxels (or points) of each object are removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.adversary.per_object_best import jittered
from advpipe.pipeline.adversary.removal_problem import RemovalProblem
from advpipe.pipeline.detector.protocol import VoxelDetector

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class DetachProblem(RemovalProblem):
    """It proposes the points whose removal raises the loss the most, by the gradient."""

    def gains(self, left: Int64) -> tuple[Float64, Int64]:
        """The estimated gain of removing each remaining point, and its group: points that count together."""
        goal, detector = self.objective.goal, self.objective.detector
        points = torch.from_numpy(jittered(self.points[left], self.jitter_m, self.rng))
        loss_targets = goal.loss_targets
        if not isinstance(detector, VoxelDetector):
            return self._gains_of_points(points, self.owner[left]), np.arange(len(left))
        loss, occupancy, voxel = detector.occupancy_loss(points, loss_targets.boxes, loss_targets.labels)
        (gradient,) = gradients_of(loss, occupancy)
        of_voxel = np.nan_to_num(-goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        row = voxel.cpu().numpy()
        count = np.bincount(row[row >= 0], minlength=len(of_voxel))
        gain = np.where(row >= 0, (of_voxel / np.maximum(count, 1))[row], 0.0)
        if not gain.any():
            raise NoGradientError
        return gain, np.where(row >= 0, row, len(of_voxel) + np.arange(len(row)))

    def _gains_of_points(self, points: torch.Tensor, owner: Int64) -> Float64:
        """First-order gain by the loss alone: dropping a point is like moving it to its object's centre,
        where it carries no information (Zheng et al. 2019, "PointCloud Saliency Maps", section 3.2)."""
        goal, detector = self.objective.goal, self.objective.detector
        leaf, loss_targets = points.requires_grad_(), goal.loss_targets
        loss = detector.loss(leaf, loss_targets.boxes, loss_targets.labels)
        (gradient,) = gradients_of(loss, leaf)
        slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
        if not slope.any():
            raise NoGradientError
        inwards = goal.targets.boxes.double().numpy()[owner, :3] - leaf.detach().double().numpy()[:, :3]
        gain: Float64 = goal.sign * (slope * inwards).sum(axis=1)
        return gain
