"""The allocation problem of `detach`: which voxels (or points) of each object are removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.adversary.removal_problem import RemovalProblem
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
        if not (will_propose and isinstance(detector, VoxelDetector)):
            return super().detected(points, left, will_propose)
        self._gain[:] = 0
        targets = goal.loss_targets
        computed = detector.occupancy_loss(torch.from_numpy(points), targets.boxes, targets.labels)
        (gradient,) = gradients_of(computed.loss, computed.occupancy)
        of_voxel = np.nan_to_num(-goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        row = computed.rows.cpu().numpy()
        count = np.bincount(row[row >= 0], minlength=len(of_voxel))
        self._gain[left] = np.where(row >= 0, (of_voxel / np.maximum(count, 1))[row], 0.0)
        self._group[left] = np.where(row >= 0, row, len(of_voxel) + np.arange(len(row)))
        return super().detected(points, left, will_propose) if computed.found is None else computed.found
