"""Crossing voxel faces: move the points that empty and fill the voxels which the detector's answer hangs on.

A detector on voxels reads which of them are occupied, hardly where in them the points lie. So each round
asks for the gradient of the loss to the occupancy of every voxel in reach, empty ones included, and lets
points cross where that gains most: singly, or all points of a voxel together so that it empties.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.detector.protocol import VoxelDetector
from advpipe.stages.attack.lidar.constraints import Rules
from advpipe.stages.attack.lidar.crossings import find_crossings
from advpipe.stages.attack.lidar.goal import Goal
from advpipe.stages.attack.lidar.gradient import gradients_of
from advpipe.stages.attack.lidar.per_object_best import jittered
from advpipe.stages.attack.lidar.selection import NoGradientError

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

INTENSITY_STEP = 0.2
"""Of the cloud's range of intensities, a step where they are attacked."""


@dataclass(frozen=True)
class Tactics:
    """How crossings are chosen; chosen by measurement (benchmarks/ingredients.py).

    margin_m: points this near to an object take part. landing_m: how far past a face they land.
    momentum: share of the earlier rounds in a voxel's gain. eager, calm: the probability that a crossing
    that gains is made, in the first and in the last round of a cycle. rounds_a_cycle: each cycle starts
    from the best that was kept. jitter_m: standard deviation of the noise under which gains are asked for.
    groups: whole voxels may be emptied together. keep: judge attempts and keep the best. decoys: false
    detections of the clean cloud are made surer. lie: every other gradient is that of a truth which holds the
    decoys alone, if any; the focal loss of what is sure is flat, that of what should not be there is steep.
    """

    margin_m: float = 1.0
    landing_m: float = 0.001
    momentum: float = 0.5
    eager: float = 0.9
    calm: float = 0.2
    rounds_a_cycle: int = 12
    jitter_m: float = 0.0
    groups: bool = True
    keep: bool = True
    decoys: bool = True
    lie: bool = True


class Crossing:
    """One cloud under attack: points (N, 4) float32, all finite."""

    def __init__(
        self,
        points: Float32,
        goal: Goal,
        detector: VoxelDetector,
        rules: Rules,
        owner: Int64,
        reach_m: float,
        tactics: Tactics,
        rng: np.random.Generator,
    ) -> None:
        """rules: what may be touched. owner: (N,) the object that a point belongs to, -1 for none: those
        stay. reach_m: how far a point may move."""
        self.points, self.goal, self.detector, self.rules = points, goal, detector, rules
        self.tactics, self.rng = tactics, rng
        self.grid = detector.voxel_grid
        keys = self.grid.keys(self.grid.cells(points))
        self.movable = np.flatnonzero((owner >= 0) & (keys >= 0) & rules.allowed)
        constraints = rules.constraints
        self.options = find_crossings(
            points[self.movable, :3],
            self.grid,
            reach_m,
            min(tactics.landing_m, reach_m / 2),  # a short reach lands nearer, rather than nowhere
            constraints.along_ray,
            rules.hidden if constraints.keep_occlusion_order else None,
        )
        fixed = np.delete(keys, self.movable)
        at = np.searchsorted(self.options.keys, fixed[np.isin(fixed, self.options.keys)])
        self.fixed_count = np.bincount(at, minlength=len(self.options.keys))
        self.intensity = points[self.movable, 3].copy()
        self.gain = np.zeros(len(self.options.keys))
        self.asked = np.zeros(len(self.options.keys), bool)
        # An empty voxel is tried with the point that has the shortest way into it.
        by_length = np.lexsort((self.options.length_m, self.options.cell))
        _, first = np.unique(self.options.cell[by_length], return_index=True)
        self.visitor = by_length[first]
        self.choice = self.options.home.copy()
        self.kept = self.choice.copy()

    def attempts(self, rounds: int) -> Iterator[Float32]:
        """The points (N, 4) after each gradient."""
        tactics = self.tactics
        cycle = min(tactics.rounds_a_cycle, rounds)
        for number in range(rounds):
            phase = number % cycle
            if phase == 0:
                self.choice = self.kept.copy()
            standing = np.bincount(self.options.cell[self.choice], minlength=len(self.gain))
            count = self.fixed_count + standing  # points in each voxel
            self._ask(self.choice, count, lie=tactics.lie and self.goal.sign > 0 and number % 2 == 1)
            probability = tactics.eager + (tactics.calm - tactics.eager) * phase / max(1, cycle - 1)
            self.choice = self._cross(self.choice, count, probability)
            yield self.placed(self.choice)

    def keep(self, better: Bool) -> None:
        """The next cycle starts from the best of each point."""
        better = better[self.movable]
        self.kept[better] = self.choice[better]

    def placed(self, choice: Int64) -> Float32:
        """The points (N, 4) where each movable one stands at its choice (P,)."""
        moved = self.points.copy()
        moved[self.movable, :3] = move_within(self.points[self.movable, :3], self.options.offset_m[choice])
        moved[self.movable, 3] = self.intensity
        return moved

    def _ask(self, choice: Int64, count: Int64, lie: bool) -> None:
        """Bring the gain of each voxel in reach up to date, by one backward pass."""
        points = jittered(self.placed(choice), self.tactics.jitter_m, self.rng)
        empty = np.flatnonzero(count == 0)
        visitor = self.visitor[empty]
        ghosts = self.points[self.movable[self.options.point[visitor]]]
        ghosts[:, :3] = move_within(ghosts[:, :3], self.options.offset_m[visitor])
        loss_targets, sign = (self.goal.decoys, -1.0) if lie else (self.goal.loss_targets, self.goal.sign)
        leaf = torch.from_numpy(points).requires_grad_()
        loss, occupancy, rows = self.detector.occupancy_loss(
            leaf, loss_targets.boxes, loss_targets.labels, torch.from_numpy(ghosts)
        )
        if self.rules.constraints.intensity:
            gradient, to_points = gradients_of(loss, occupancy, leaf)
            self._shine(sign * to_points[self.movable, 3].cpu().double().numpy())
        else:
            (gradient,) = gradients_of(loss, occupancy)
        worth = np.nan_to_num(gradient.cpu().numpy().astype(np.float64), posinf=0.0, neginf=0.0)
        if not worth.any() and (lie or self.asked.any()):
            return  # the loss says nothing of what should not be there, or nothing more: what was kept stays
        if not worth.any():
            raise NoGradientError
        worth *= sign / np.abs(worth).mean()  # the scales of losses differ
        row = rows.cpu().numpy()
        read = row >= 0
        key = self.grid.keys(self.grid.cells(np.concatenate([points, ghosts])[read]))
        key, first = np.unique(key, return_index=True)
        here = np.isin(key, self.options.keys)
        cell, new = np.searchsorted(self.options.keys, key[here]), worth[row[read][first[here]]]
        memory = np.where(self.asked[cell], self.tactics.momentum, 0.0)
        self.gain[cell] = memory * self.gain[cell] + (1 - memory) * new
        self.asked[cell] = True

    def _shine(self, rises: Float64) -> None:
        """One step of the intensities (P,), within what the clean cloud knows."""
        low, high = self.points[:, 3].min(), self.points[:, 3].max()
        step = INTENSITY_STEP * (high - low) * np.sign(np.nan_to_num(rises))
        if self.rules.constraints.max_points is None:
            self.intensity = np.clip(self.intensity + step, low, high).astype(np.float32)

    def _cross(self, choice: Int64, count: Int64, probability: float) -> Int64:
        """The next choice (P,): what gains is made with some probability. count: (C,) points in a voxel."""
        options, gain = self.options, self.gain
        here = options.cell[choice]
        is_move = options.cell != here[options.point]
        enter = np.where(count == 0, gain, 0.0)  # of a voxel
        leave = np.where(count == 1, -gain, 0.0)
        worth = np.where(is_move, enter[options.cell], -np.inf)
        # The most worthy option of each point, a shorter way first where all else is equal.
        worth = worth - 1e-12 * options.length_m
        order = np.lexsort((-worth, options.point))
        best = order[np.searchsorted(options.point[order], np.arange(len(choice)))]
        single = np.where(np.isfinite(worth[best]), worth[best], -np.inf) + leave[here]
        taken = (single > 0) & (self.rng.random(len(choice)) < probability)
        # Of several points that would enter one empty voxel, the worthiest alone goes.
        into = options.cell[best]
        arriving = np.flatnonzero(taken & (count[into] == 0))
        arriving = arriving[np.lexsort((-single[arriving], into[arriving]))]
        _, first = np.unique(into[arriving], return_index=True)
        taken[np.delete(arriving, first)] = False
        if self.tactics.groups:
            taken |= self._groups(choice, best, worth, count, taken, probability)
        after = np.where(taken, best, choice)
        if self.rules.constraints.max_points is not None:  # the least worthy moves are undone
            worth_of_points = np.zeros(len(self.points))
            brought = gain[options.cell[after]] - gain[options.cell[options.home]]
            moved = after != options.home
            worth_of_points[self.movable] = np.where(moved, np.maximum(brought, 1e-12), 0.0)
            after = np.where(self.rules.limit(worth_of_points)[self.movable], after, options.home)
        return after

    def _groups(
        self, choice: Int64, best: Int64, worth: Float64, count: Int64, taken: Bool, probability: float
    ) -> Bool:
        """Which points (P,) leave their voxel together, so that it empties."""
        options = self.options
        here = options.cell[choice]
        several = (count > 1) & (self.fixed_count == 0)
        can = np.isfinite(worth[best])
        stuck = np.zeros(len(count), bool)
        stuck[here[~can]] = True
        members = np.flatnonzero(several[here] & ~stuck[here])
        if not len(members):
            return np.zeros(len(choice), bool)
        # What a group brings: each voxel that it fills once, and its own one emptied.
        pair = here[members] * len(count) + options.cell[best[members]]
        _, one_each = np.unique(pair, return_index=True)
        brings = np.bincount(here[members[one_each]], worth[best[members[one_each]]], len(count))
        alone = np.maximum(worth[best[members[one_each]]], 0)
        alone_brings = np.bincount(here[members[one_each]], alone, len(count))
        total = brings - self.gain
        goes = several & ~stuck & (total > 0) & (total > alone_brings)
        goes &= self.rng.random(len(count)) < probability
        leaving = np.zeros(len(choice), bool)
        leaving[members] = goes[here[members]]
        return leaving
