"""The allocation problem of `attach`: which places near each object get a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.addition_problem import AdditionProblem
from advpipe.pipeline.adversary.expectation import View
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.occupancy_gradient import occupancy_gradients
from advpipe.pipeline.detector.protocol import Detections, VoxelDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(eq=False, kw_only=True)
class AttachProblem(AdditionProblem):
    """It proposes the places where a point raises the loss the most, by the gradient of the latest look.

    decay_m: a place d away from its clean point counts exp(-(d / decay_m)**2).
    """

    decay_m: float

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        if len(self._pool) and not self._gain[self._pool].any():
            raise NoGradientError
        return super().propose(taken, wanted, room)

    def assessed(self, points: Float32, shown: Int64) -> tuple[Detections, Float64]:
        detector = self.objective.detector
        if not isinstance(detector, VoxelDetector):
            return super().assessed(points, shown)
        found, gain = self._occupancy_gains(detector, points)
        if found is None:
            found = detector.detect(cloud_of_xyzi(points))
        return found, gain * np.exp(-((self.places.distance_m[self._pool] / self.decay_m) ** 2))

    def _occupancy_gains(self, detector: VoxelDetector, points: Float32) -> tuple[Detections | None, Float64]:
        """The gradient of the loss with respect to the occupancy of each place's voxel."""
        goal = self.objective.goal
        return addition_gains(goal, detector, points, self.places.points[self._pool])


def addition_gains(
    goal: AttackGoal, detector: VoxelDetector, points: Float32, probes: Float32, view: View | None = None
) -> tuple[Detections | None, Float64]:
    """What the detector finds in points (N, 4), where the pass tells; and the gain (G,) of a point at each
    probe (G, 4), 0 where its voxel is occupied. view: as it sees them, if otherwise."""
    targets = goal.loss_targets if view is None else view.targets(goal.loss_targets)
    shown, seen_probes = (points, probes) if view is None else (view.points, view.probes(probes))
    computed = detector.occupancy_loss(
        torch.from_numpy(shown), targets.boxes, targets.labels, torch.from_numpy(seen_probes)
    )
    back = None if view is None or computed.found is None else view.found_back(computed.found)
    places = np.concatenate([points if view is None else points[view.source], probes])
    (gradient,) = occupancy_gradients(computed, goal, places, found=back)
    of_row = np.nan_to_num(goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
    of_row[computed.occupancy.detach().cpu().numpy() > 0] = 0.0
    mine = computed.rows.cpu().numpy()[len(shown) :]
    return computed.found, np.append(of_row, 0.0)[mine]  # 0 for a probe that the detector ignores
