"""The allocation problem of `detach`: which voxels (or points) of each object are removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.adversary.removal_problem import RemovalProblem
from advpipe.pipeline.adversary.targets import AttackTargets
from advpipe.pipeline.detector.protocol import Detections, VoxelDetector

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(eq=False)
class DetachProblem(RemovalProblem):
    """It proposes the points whose removal raises the loss the most, by the gradient of the latest look."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._gain, self._group = np.zeros(len(self.points)), np.arange(len(self.points))

    def gains(self, left: Int64) -> tuple[Float64, Int64]:
        if not self._gain.any():
            raise NoGradientError
        return self._gain[left], self._group[left]

    def detected(self, points: Float32, left: Int64, will_propose: bool) -> Detections:
        """What the detector finds; and the gains, of all points of a voxel together."""
        goal, detector = self.objective.goal, self.objective.detector
        if not will_propose:
            return super().detected(points, left, will_propose)
        self._gain[:] = 0
        if not isinstance(detector, VoxelDetector):
            self._gain[left] = self._gains_of_points(torch.from_numpy(points), self.owner[left])
            return super().detected(points, left, will_propose)
        found, self._gain[left], self._group[left] = removal_gains(goal, detector, points, goal.loss_targets)
        return super().detected(points, left, will_propose) if found is None else found

    def _gains_of_points(self, points: torch.Tensor, owner: Int64) -> Float64:
        """First-order gain by the loss alone: dropping a point is like moving it to its object's centre,
        where it carries no information (Zheng et al. 2019, "PointCloud Saliency Maps", section 3.2)."""
        goal, detector = self.objective.goal, self.objective.detector
        leaf, loss_targets = points.requires_grad_(), goal.loss_targets
        loss = detector.loss(leaf, loss_targets.boxes, loss_targets.labels)
        (gradient,) = gradients_of(loss, leaf)
        slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
        inwards = goal.targets.boxes.double().numpy()[owner, :3] - leaf.detach().double().numpy()[:, :3]
        gain: Float64 = goal.sign * (slope * inwards).sum(axis=1)
        return gain


def removal_gains(
    goal: AttackGoal, detector: VoxelDetector, points: Float32, targets: AttackTargets
) -> tuple[Detections | None, Float64, Int64]:
    """What the detector finds in points (N, 4), where the pass tells; the gain (N,) of removing each point,
    its share of its voxel's, and its voxel (N,). targets: of the loss, in the frame of these points."""
    computed = detector.occupancy_loss(torch.from_numpy(points), targets.boxes, targets.labels)
    (gradient,) = gradients_of(computed.loss, computed.occupancy)
    of_voxel = np.nan_to_num(-goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
    row = computed.rows.cpu().numpy()
    count = np.bincount(row[row >= 0], minlength=len(of_voxel))
    gain = np.append(of_voxel / np.maximum(count, 1), 0.0)[row]  # 0 for a point that the detector ignores
    return computed.found, gain, np.where(row >= 0, row, len(of_voxel) + np.arange(len(row)))
