"""The allocation problem of `attach`: which places near each object get a point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.stages.attack.lidar.attach_places import Places
from advpipe.stages.attack.lidar.attack_objective import AttackObjective
from advpipe.stages.attack.lidar.goal import AttackGoal
from advpipe.stages.attack.lidar.gradient import gradients_of
from advpipe.stages.attack.lidar.selection import NoGradientError

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_POINTS_PER_OBJECT = 60
"""The most points of one object during the search; a ghost object may take all places."""

KEPT_CANDIDATES, NEW_CANDIDATES = 300, 500
"""Places of an object that are evaluated each round: the best of earlier rounds, and random new ones."""


@dataclass(frozen=True)
class AttachProblem:
    """The items are places; taking one adds a point there.

    clean: (N, 4) float32. decay_m: a place d away from its clean point counts exp(-(d / decay_m)**2).
    jitter_m: standard deviation of the noise for gradients and evaluations; 0 for none.
    is_random: propose random places, for the random baseline with the same selection.
    """

    clean: Float32
    places: Places
    goal: AttackGoal
    objective: AttackObjective
    detector: ObjectDetector
    rng: np.random.Generator
    decay_m: float
    jitter_m: float = 0.0
    is_random: bool = False
    _gain: Float64 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_gain", np.full(len(self.places), -np.inf))

    @property
    def max_items(self) -> Int64:
        owner = self.places.owner
        available = np.bincount(owner[owner >= 0], minlength=len(self.goal.targets))
        return available if self.goal.aim == "create" else np.minimum(available, MAX_POINTS_PER_OBJECT)

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        free = np.ones(len(self.places), bool)
        free[taken] = False
        pools = [self._pool(np.flatnonzero(free & (self.places.owner == m))) for m in np.flatnonzero(wanted)]
        pool = np.concatenate([np.zeros(0, np.int64), *pools])
        if len(pool):
            self._gain[pool] = self._gains(taken, pool)
        proposals = []
        for number, count in enumerate(wanted):
            mine = pool[self.places.owner[pool] == number] if count else np.zeros(0, np.int64)
            best = mine[np.argsort(-self._gain[mine], kind="stable")[:count]]
            proposals.append(best[self._gain[best] > 0])
        return proposals

    def evaluate(self, taken: Int64) -> Float64:
        return self.objective(self._jittered(np.concatenate([self.clean, self.places.points[taken]])))

    def is_satisfied(self, values: Float64) -> Bool:
        return self.objective.is_satisfied(values)

    def _pool(self, mine: Int64) -> Int64:
        """The places of an object to evaluate in this round."""
        known = np.isfinite(self._gain[mine])
        best = mine[known][np.argsort(-self._gain[mine[known]], kind="stable")[:KEPT_CANDIDATES]]
        fresh = self.rng.permutation(mine[~known])[
            : NEW_CANDIDATES if known.any() else KEPT_CANDIDATES + NEW_CANDIDATES
        ]
        return np.concatenate([best, fresh])

    def _gains(self, taken: Int64, pool: Int64) -> Float64:
        """The estimated gain (K,) of a point at each place of the pool, beside those taken."""
        if self.is_random:
            return self.rng.random(len(pool)) + 1e-9
        points = torch.from_numpy(self._jittered(np.concatenate([self.clean, self.places.points[taken]])))
        if isinstance(self.detector, VoxelDetector):
            gain = self._occupancy_gains(self.detector, points, pool)
        else:
            gain = self._copy_gains(points, pool)
        if not gain.any():
            raise NoGradientError
        return gain * np.exp(-((self.places.distance_m[pool] / self.decay_m) ** 2))

    def _occupancy_gains(self, detector: VoxelDetector, points: torch.Tensor, pool: Int64) -> Float64:
        """The gradient of the loss with respect to the occupancy of each place's voxel."""
        loss_targets, probes = self.goal.loss_targets, torch.from_numpy(self.places.points[pool])
        computed = detector.occupancy_loss(points, loss_targets.boxes, loss_targets.labels, probes)
        (gradient,) = gradients_of(computed.loss, computed.occupancy)
        of_row = np.nan_to_num(self.goal.sign * gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        mine = computed.rows.cpu().numpy()[len(points) :]
        return np.where(mine >= 0, of_row[mine], 0.0)

    def _copy_gains(self, points: torch.Tensor, pool: Int64) -> Float64:
        """First-order gain by the loss alone: a copy of the place's clean point, moved to the place."""
        leaf, loss_targets = points.requires_grad_(), self.goal.loss_targets
        (gradient,) = gradients_of(self.detector.loss(leaf, loss_targets.boxes, loss_targets.labels), leaf)
        slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
        source = self.places.source[pool]
        way_m = self.places.points[pool, :3].astype(np.float64) - self.clean[source, :3]
        gain: Float64 = self.goal.sign * (slope[source] * way_m).sum(axis=1)
        return gain

    def _jittered(self, points: Float32) -> Float32:
        if not self.jitter_m:
            return points
        noise = np.zeros(points.shape)
        noise[:, :3] = self.rng.normal(0, self.jitter_m, (len(points), 3))
        return (points + noise).astype(np.float32)
