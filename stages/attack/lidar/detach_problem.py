"""The allocation problem of `detach`: which voxels (or points) of each object are removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.stages.attack.lidar.attack_objective import AttackObjective
from advpipe.stages.attack.lidar.goal import AttackGoal
from advpipe.stages.attack.lidar.gradient import gradients_of
from advpipe.stages.attack.lidar.selection import NoGradientError

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_SHARE_PER_OBJECT = 0.85
"""The largest share of its points that an object may lose during the search."""


@dataclass(frozen=True)
class DetachProblem:
    """The items are points of the clean cloud, (N, 4); taking one removes it.

    owner: (N,) the object of the goal that each point belongs to, -1 for one that must not be touched.
    jitter_m: standard deviation of the noise for gradients and evaluations; 0 for none.
    is_random: propose random points, for the random baseline with the same selection.
    """

    points: Float32
    owner: Int64
    goal: AttackGoal
    objective: AttackObjective
    detector: ObjectDetector
    rng: np.random.Generator
    jitter_m: float = 0.0
    is_random: bool = False

    @property
    def max_items(self) -> Int64:
        of_object = np.bincount(self.owner[self.owner >= 0], minlength=len(self.goal.targets))
        most: Int64 = np.ceil(MAX_SHARE_PER_OBJECT * of_object).astype(np.int64)
        return most

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        left = np.setdiff1d(np.arange(len(self.points)), taken, assume_unique=True)
        gain, group = self._gains(left)
        proposals = []
        for number, (count, most) in enumerate(zip(wanted.tolist(), room.tolist(), strict=True)):
            mine = np.flatnonzero(self.owner[left] == number) if count else np.zeros(0, np.int64)
            proposals.append(left[mine[_whole_groups(gain[mine], group[mine], count, most)]])
        return proposals

    def evaluate(self, taken: Int64) -> Float64:
        return self.objective(self._jittered(np.delete(self.points, taken, axis=0)))

    def is_satisfied(self, values: Float64) -> Bool:
        return self.objective.is_satisfied(values)

    def _gains(self, left: Int64) -> tuple[Float64, Int64]:
        """The estimated gain of removing each remaining point, and its group: points that count together."""
        if self.is_random:
            return self.rng.random(len(left)), np.arange(len(left))
        points = torch.from_numpy(self._jittered(self.points[left]))
        loss_targets = self.goal.loss_targets
        if not isinstance(self.detector, VoxelDetector):
            return self._gains_of_points(points, self.owner[left]), np.arange(len(left))
        computed = self.detector.occupancy_loss(points, loss_targets.boxes, loss_targets.labels)
        (gradient,) = gradients_of(computed.loss, computed.occupancy)
        of_voxel = np.nan_to_num(-self.goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        row = computed.rows.cpu().numpy()
        count = np.bincount(row[row >= 0], minlength=len(of_voxel))
        gain = np.where(row >= 0, (of_voxel / np.maximum(count, 1))[row], 0.0)
        if not gain.any():
            raise NoGradientError
        return gain, np.where(row >= 0, row, len(of_voxel) + np.arange(len(row)))

    def _gains_of_points(self, points: torch.Tensor, owner: Int64) -> Float64:
        """First-order gain by the loss alone: dropping a point is like moving it to its object's centre,
        where it carries no information (Zheng et al. 2019, "PointCloud Saliency Maps", section 3.2)."""
        leaf, loss_targets = points.requires_grad_(), self.goal.loss_targets
        loss = self.detector.loss(leaf, loss_targets.boxes, loss_targets.labels)
        (gradient,) = gradients_of(loss, leaf)
        slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
        if not slope.any():
            raise NoGradientError
        inwards = self.goal.targets.boxes.double().numpy()[owner, :3] - leaf.detach().double().numpy()[:, :3]
        gain: Float64 = self.goal.sign * (slope * inwards).sum(axis=1)
        return gain

    def _jittered(self, points: Float32) -> Float32:
        if not self.jitter_m:
            return points
        noise = np.zeros(points.shape)
        noise[:, :3] = self.rng.normal(0, self.jitter_m, (len(points), 3))
        return (points + noise).astype(np.float32)


def _whole_groups(gain: Float64, group: Int64, count: int, room: int) -> Int64:
    """Indices (K,) of whole groups in order of positive gain per point, until there are `count` points;
    groups larger than the remaining `room` are skipped, unless none fits."""
    order = np.lexsort((group, -gain))
    order = order[gain[order] > 0]
    if not count or not len(order):
        return np.zeros(0, np.int64)
    chosen: list[Int64] = []
    size = 0
    for members in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        if size + len(members) <= room:
            chosen.append(members)
            size += len(members)
        if size >= count:
            break
    return np.concatenate(chosen) if chosen else order[:room]
