"""The allocation problem of `detach`: which voxels (or points) of each object are removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.expectation import View
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.occupancy_gradient import occupancy_gradients
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
        found, self._gain[left], self._group[left] = removal_gains(goal, detector, points)
        return super().detected(points, left, will_propose) if found is None else found


def removal_gains(
    goal: AttackGoal, detector: VoxelDetector, points: Float32, view: View | None = None
) -> tuple[Detections | None, Float64, Int64]:
    """What the detector finds in points (N, 4), where the pass tells; the gain (N,) of removing each point,
    its share of its voxel's, and its voxel (N,). view: as it sees them, if otherwise."""
    targets = goal.loss_targets if view is None else view.targets(goal.loss_targets)
    shown = points if view is None else view.points
    computed = detector.occupancy_loss(torch.from_numpy(shown), targets.boxes, targets.labels)
    back = None if view is None or computed.found is None else view.found_back(computed.found)
    places = points if view is None else points[view.source]
    (gradient,) = occupancy_gradients(computed, goal, places, found=back)
    of_voxel = np.nan_to_num(-goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
    row = computed.rows.cpu().numpy()
    count = np.bincount(row[row >= 0], minlength=len(of_voxel))
    gain = np.append(of_voxel / np.maximum(count, 1), 0.0)[row]  # 0 for a point that the detector ignores
    return computed.found, gain, np.where(row >= 0, row, len(of_voxel) + np.arange(len(row)))
