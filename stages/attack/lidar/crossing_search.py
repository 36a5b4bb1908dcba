"""A search that moves points across voxel faces to empty and fill the voxels that matter to the detector.

A voxel detector reads which voxels are occupied, but hardly where in a voxel its points are. So each round
computes the gradient of the loss with respect to the occupancy of every voxel in reach, empty ones included,
and points cross where the gain is largest: single points, or all points of a voxel so that it empties.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.occupancy_gradient import occupancy_gradients
from advpipe.pipeline.adversary.random_best import MOVE_MARGIN_M
from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.detector.protocol import VoxelDetector
from advpipe.stages.attack.lidar.crossings import find_crossings
from advpipe.stages.attack.lidar.search import Candidate

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

INTENSITY_STEP = 0.2
"""A step of attacked intensities, as a fraction of the cloud's intensity range."""


@dataclass(frozen=True)
class CrossingSettings:
    """Settings of the search, tuned by measurement (benchmarks/ingredients.py).

    margin_m: points this near to an object may move. landing_m: how far past a face they land.
    momentum: weight of the earlier rounds in a voxel's gain. first_probability, last_probability: of making a
    crossing with a positive gain, in the first and in the last round of a cycle. rounds_per_cycle: each cycle
    starts from the best points so far. groups: all points of a voxel may leave it together. keep_best:
    evaluate the candidates and keep the best points of each object. decoys: raise the scores of false
    detections of the clean cloud. decoy_gradients: take every other gradient for a ground truth of the decoys
    alone, if any: the focal loss is flat for confident detections and steep for false ones. spread: on rays,
    points land anywhere in a voxel instead of behind its face. patience: after so many rounds without
    progress, the points of an object go on from its best; 0 for never.
    """

    margin_m: float = MOVE_MARGIN_M
    landing_m: float = 0.001
    momentum: float = 0.5
    first_probability: float = 0.9
    last_probability: float = 0.2
    rounds_per_cycle: int = 12
    groups: bool = True
    keep_best: bool = True
    decoys: bool = True
    decoy_gradients: bool = True
    spread: bool = False
    patience: int = 0


class CrossingSearch:
    """The search on one cloud: points (N, 4) float32, all finite; a `Search`."""

    def __init__(
        self,
        points: Float32,
        goal: AttackGoal,
        detector: VoxelDetector,
        rules: Rules,
        owner: Int64,
        focus: Focus,
        reach_m: float,
        settings: CrossingSettings,
        rng: np.random.Generator,
    ) -> None:
        """rules: which points may move. owner: (N,) the object that each point belongs to; points with -1
        stay. focus: the part of the points that is looked at. reach_m: how far a point may move."""
        self.points, self.goal, self.detector, self.rules = points, goal, detector, rules
        self.focus, self.settings, self.rng = focus, settings, rng
        self.grid = detector.voxel_grid
        keys = self.grid.keys(self.grid.cells(points))
        self.movable = np.flatnonzero((owner >= 0) & (keys >= 0) & rules.allowed)
        self.owner = owner[self.movable]
        constraints = rules.constraints
        self.options = find_crossings(
            points[self.movable, :3],
            self.grid,
            reach_m,
            min(settings.landing_m, reach_m / 2),  # with a short reach, land nearer to the face
            constraints.along_ray,
            rules.hidden if constraints.keep_occlusion_order else None,
            rng if settings.spread else None,
        )
        fixed = np.delete(keys, self.movable)
        at = np.searchsorted(self.options.keys, fixed[np.isin(fixed, self.options.keys)])
        self.fixed_count = np.bincount(at, minlength=len(self.options.keys))
        self.intensity = points[self.movable, 3].copy()
        self.gain = np.zeros(len(self.options.keys))
        self.has_gain = np.zeros(len(self.options.keys), bool)
        # Each empty voxel is probed with the point that has the shortest way into it.
        by_length = np.lexsort((self.options.length_m, self.options.cell))
        _, first = np.unique(self.options.cell[by_length], return_index=True)
        self.probe_option = by_length[first]
        self.choice = self.options.home.copy()
        self.kept = self.choice.copy()
        self.rounds_without = np.zeros(len(focus.is_open), np.int64)

    def candidates(self, rounds: int) -> Iterator[Candidate]:
        """The points (N, 4) of each gradient, the clean ones first, and those after each cycle: so many
        rounds without the clean ones."""
        settings = self.settings
        cycle = min(settings.rounds_per_cycle, rounds)
        for number in range(rounds + 1 - math.ceil(rounds / cycle)):
            phase = number % cycle
            if number and phase == 0:
                yield Candidate(self.placed(self.choice))
                self.choice = self.kept.copy()
            if not self.focus.is_open.any():
                return
            standing = np.bincount(self.options.cell[self.choice], minlength=len(self.gain))
            count = self.fixed_count + standing  # points in each voxel
            toward_decoys = settings.decoy_gradients and self.goal.sign > 0 and number % 2 == 1
            yield self._evaluated(count, toward_decoys)
            if settings.patience:
                count = self.fixed_count + np.bincount(
                    self.options.cell[self.choice], minlength=len(self.gain)
                )
            first, last = settings.first_probability, settings.last_probability
            probability = first + (last - first) * phase / max(1, cycle - 1)
            self.choice = self._cross(self.choice, count, probability)
        yield Candidate(self.placed(self.choice))

    def accept(self, better: Bool) -> None:
        """Start the next cycle from the best choice of each point; of an object without progress, the next
        round."""
        better = better[self.movable]
        self.kept[better] = self.choice[better]
        if self.settings.patience:
            self.rounds_without += 1
            self.rounds_without[self.owner[better]] = 0
            waits = self.rounds_without >= self.settings.patience
            self.rounds_without[waits] = 0
            self.choice[waits[self.owner]] = self.kept[waits[self.owner]]
        done = ~self.focus.is_open[self.owner]
        self.choice[done] = self.kept[done]

    def placed(self, choice: Int64) -> Float32:
        """The points (N, 4) with the movable ones at their chosen options (P,)."""
        moved = self.points.copy()
        moved[self.movable, :3] = move_within(self.points[self.movable, :3], self.options.offset_m[choice])
        moved[self.movable, 3] = self.intensity
        return moved

    def _evaluated(self, count: Int64, toward_decoys: bool) -> Candidate:
        """The current points, and the gain of each voxel near the open objects, by one pass."""
        placed, shown = self.placed(self.choice), self.focus.shown
        points = placed[shown]
        can_enter = self.focus.is_open[self.owner[self.options.point[self.probe_option]]]
        probe_option = self.probe_option[(count == 0) & can_enter]
        probes = self.points[self.movable[self.options.point[probe_option]]]
        probes[:, :3] = move_within(probes[:, :3], self.options.offset_m[probe_option])
        loss_targets, sign = (
            (self.goal.decoys, -1.0) if toward_decoys else (self.goal.loss_targets, self.goal.sign)
        )
        leaf = torch.from_numpy(points).requires_grad_()
        computed = self.detector.occupancy_loss(
            leaf, loss_targets.boxes, loss_targets.labels, torch.from_numpy(probes)
        )
        places = np.concatenate([points, probes])
        if self.rules.constraints.intensity:
            gradient, to_points = occupancy_gradients(computed, self.goal, places, leaf)
            of_cloud = np.zeros(len(self.points))
            of_cloud[shown] = sign * to_points[:, 3].cpu().double().numpy()
            self._step_intensity(of_cloud[self.movable])
        else:
            (gradient,) = occupancy_gradients(computed, self.goal, places)
        candidate = Candidate(placed, computed.found)
        worth = np.nan_to_num(gradient.cpu().numpy().astype(np.float64), posinf=0.0, neginf=0.0)
        if not worth.any() and (toward_decoys or self.has_gain.any()):
            return candidate  # no gradient for decoys, or no more gradient: keep the earlier gains
        if not worth.any():
            raise NoGradientError
        worth *= sign / np.abs(worth).mean()  # the scales of losses differ
        row = computed.rows.cpu().numpy()
        read = row >= 0
        key = self.grid.keys(self.grid.cells(places[read]))
        key, first = np.unique(key, return_index=True)
        here = np.isin(key, self.options.keys)
        cell, new = np.searchsorted(self.options.keys, key[here]), worth[row[read][first[here]]]
        memory = np.where(self.has_gain[cell], self.settings.momentum, 0.0)
        self.gain[cell] = memory * self.gain[cell] + (1 - memory) * new
        self.has_gain[cell] = True
        return candidate

    def _step_intensity(self, rises: Float64) -> None:
        """Step the intensities (P,) within the range of the clean cloud."""
        low, high = self.points[:, 3].min(), self.points[:, 3].max()
        step = INTENSITY_STEP * (high - low) * np.sign(np.nan_to_num(rises))
        if self.rules.constraints.max_points is None:
            self.intensity = np.clip(self.intensity + step, low, high).astype(np.float32)

    def _cross(self, choice: Int64, count: Int64, probability: float) -> Int64:
        """The next choice (P,): crossings with a gain, at this probability. count: (C,) points a voxel."""
        options, gain = self.options, self.gain
        here = options.cell[choice]
        is_move = options.cell != here[options.point]
        enter = np.where(count == 0, gain, 0.0)  # of a voxel
        leave = np.where(count == 1, -gain, 0.0)
        worth = np.where(is_move, enter[options.cell], -np.inf)
        # The best option of each point; of equal ones, the shortest.
        worth = worth - 1e-12 * options.length_m
        most = np.maximum.reduceat(worth, options.home)
        equal = np.flatnonzero(worth == most[options.point])
        best = equal[np.searchsorted(options.point[equal], np.arange(len(choice)))]
        single = np.where(np.isfinite(worth[best]), worth[best], -np.inf) + leave[here]
        taken = (single > 0) & (self.rng.random(len(choice)) < probability)
        is_open = self.focus.is_open[self.owner]
        taken &= is_open
        # Of several points that would enter one empty voxel, only the one with the largest gain does.
        into = options.cell[best]
        arriving = np.flatnonzero(taken & (count[into] == 0))
        arriving = arriving[np.lexsort((-single[arriving], into[arriving]))]
        _, first = np.unique(into[arriving], return_index=True)
        taken[np.delete(arriving, first)] = False
        if self.settings.groups:
            taken |= is_open & self._groups(choice, best, worth, count, probability)
        after = np.where(taken, best, choice)
        if self.rules.constraints.max_points is not None:  # undo the moves with the smallest gains
            worth_of_points = np.zeros(len(self.points))
            brought = gain[options.cell[after]] - gain[options.cell[options.home]]
            moved = after != options.home
            worth_of_points[self.movable] = np.where(moved, np.maximum(brought, 1e-12), 0.0)
            after = np.where(self.rules.limit(worth_of_points)[self.movable], after, options.home)
        return after

    def _groups(self, choice: Int64, best: Int64, worth: Float64, count: Int64, probability: float) -> Bool:
        """Which points (P,) leave their voxel together to empty it."""
        options = self.options
        here = options.cell[choice]
        several = (count > 1) & (self.fixed_count == 0)
        can = np.isfinite(worth[best])
        stuck = np.zeros(len(count), bool)
        stuck[here[~can]] = True
        members = np.flatnonzero(several[here] & ~stuck[here])
        if not len(members):
            return np.zeros(len(choice), bool)
        # The gain of a group: each voxel that it fills counts once, and its emptied voxel.
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
