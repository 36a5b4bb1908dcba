"""Moves of points that hold in expectation over transformations: `robust` and `transfer` of `perturb`.

A crossing of one voxel face survives neither a sub-voxel shift nor a mirror image. So each point has 26 fixed
displacements, by its whole reach. The gain of each is a mean over draws of the transformations: of the
occupancy that it adds to the voxels of a draw, and takes from them.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.displacement import displaced
from advpipe.pipeline.adversary.expectation import Expectation, View
from advpipe.pipeline.adversary.expected_objective import still_found
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.occupancy_gradient import occupancy_gradients
from advpipe.pipeline.adversary.per_object_best import within_limit
from advpipe.pipeline.detector.protocol import Detections, VoxelDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MOMENTUM = 0.8
"""The weight of earlier rounds in the gain of a displacement: a mean over some twenty draws."""

ROUNDS_PER_CYCLE = 12
FIRST_PROBABILITY, LAST_PROBABILITY = 0.5, 0.2
"""Each cycle starts from the best points so far; of taking a displacement with a gain, in its first and last
round."""


class RobustSearch:
    """The search on one cloud: points (N, 4) float32, all finite."""

    def __init__(
        self,
        points: Float32,
        goal: AttackGoal,
        detector: VoxelDetector,
        rules: Rules,
        owner: Int64,
        reach_m: float,
        expectation: Expectation,
        rng: np.random.Generator,
    ) -> None:
        """rules: which points may move, and where to. owner: (N,) the object or decoy that each belongs to;
        points with -1 stay. reach_m: how far a point may move. expectation: the transformations."""
        self.points, self.goal, self.detector, self.rules, self.rng = points, goal, detector, rules, rng
        self.expectation = expectation
        self.focus = Focus(points, goal.regions)
        self.movable = np.flatnonzero((owner >= 0) & rules.allowed)
        self.owner = owner
        self.places = np.stack([self._moved_by(way, reach_m) for way in _ways()])  # (L, P, 3); first: to stay
        self.gain = np.zeros(self.places.shape[:2])
        self.is_known = np.zeros(len(self.movable), bool)
        self.choice = np.zeros(len(self.movable), np.int64)

    def moved(self, rounds: int) -> Float32:
        """The points (N, 4) with the best choice for each object, of so many candidates and the clean points.

        Each is judged by the mean success under the transformations. Raises NoGradientError if the loss has
        no gradient from the start.
        """
        kept = self.choice.copy()
        success = first = np.full(len(self.goal.regions), -np.inf)
        for number in range(rounds + 1):
            phase = number % ROUNDS_PER_CYCLE
            if not self.focus.is_open.any():
                break
            mean, is_done = self._judged(takes_gain=number < rounds)
            better = self.focus.is_open & (mean > success + 1e-9)
            success = np.where(better, mean, success)
            if not number:
                first = success
            taken = better[self.owner[self.movable]]
            kept[taken] = self.choice[taken]
            if number or not is_done.all():  # else nothing is found: follow the gradient everywhere
                self.focus.close(better & is_done)
            again = ~self.focus.is_open[self.owner[self.movable]] | (number > 0 and phase == 0)
            self.choice[again] = kept[again]
            share = phase / max(1, min(ROUNDS_PER_CYCLE, rounds) - 1)
            self._step(FIRST_PROBABILITY + (LAST_PROBABILITY - FIRST_PROBABILITY) * share)
        most = self.rules.constraints.max_points
        return within_limit(self._placed(kept), self.points, self.owner, success - first, most)

    def _moved_by(self, way: Float64, reach_m: float) -> Float32:
        offset = np.zeros((len(self.points), 3))
        offset[self.movable] = reach_m * way
        return displaced(self.points, self.rules.project(offset), reach_m)[self.movable, :3]

    def _placed(self, choice: Int64) -> Float32:
        moved = self.points.copy()
        moved[self.movable, :3] = self.places[choice, np.arange(len(choice))]
        return moved

    def _judged(self, *, takes_gain: bool) -> tuple[Float64, Bool]:
        """The mean success (M + D,) of the current choice, and what is lost under every transformation; the
        gains are updated on the way."""
        shown, placed = self.focus.shown, self._placed(self.choice)
        open_ = np.flatnonzero(self.focus.is_open[self.owner[self.movable]])
        gains, found = [], []
        for view in self.expectation.views(placed[shown], self.rng):
            if takes_gain:
                seen, gain = self._gains(view, placed[shown], open_)
                gains.append(gain)
            else:
                seen = self.detector.detect(cloud_of_xyzi(view.points))
            found.append(view.found_back(seen))
        if takes_gain:
            weights = still_found(self.goal, found)[:, self.owner[self.movable[open_]]]
            gain = (weights[:, None] * gains).mean(axis=0)
            if not gain.any() and not self.is_known.any():
                raise NoGradientError
            memory = np.where(self.is_known[open_], MOMENTUM, 0.0)
            self.gain[:, open_] = memory * self.gain[:, open_] + (1 - memory) * gain
            self.is_known[open_] = True
        successes = [self.goal.success(each) for each in found]
        is_done = np.all([self.goal.is_done(each) for each in successes], axis=0)
        return np.mean(successes, axis=0), is_done

    def _gains(self, view: View, given: Float32, open_: Int64) -> tuple[Detections, Float64]:
        """What the detector finds in a view of the given points, and the gain (L, P) of moving each open
        point to each of its places: of the voxel that it enters, if empty, and of leaving its own, shared by
        its points."""
        targets = view.targets(self.goal.loss_targets)
        probes = np.zeros((len(self.places), len(open_), 4), np.float32)
        probes[:, :, :3] = self.places[:, open_]
        computed = self.detector.occupancy_loss(
            torch.from_numpy(view.points), targets.boxes, targets.labels,
            torch.from_numpy(view.probes(probes.reshape(-1, 4))),
        )  # fmt: skip
        back = None if computed.found is None else view.found_back(computed.found)
        places = np.concatenate([given[view.source, :3], self.places[:, open_].reshape(-1, 3)])
        (gradient,) = occupancy_gradients(computed, self.goal, places, found=back)
        worth = self.goal.sign * np.nan_to_num(gradient.double().cpu().numpy(), posinf=0.0, neginf=0.0)
        if worth.any():
            worth /= np.abs(worth).mean()  # the scales of views differ
        worth = np.append(worth, 0.0)  # of row -1: what the detector ignores
        row = computed.rows.cpu().numpy()
        of_points, of_probes = row[: len(view.points)], row[len(view.points) :].reshape(len(probes), -1)
        count = np.bincount(of_points[of_points >= 0], minlength=len(worth))
        enter = np.where(count[of_probes] == 0, worth[of_probes], 0.0)
        home = of_probes[self.choice[open_], np.arange(len(open_))]
        leave = -worth[home] / np.maximum(count[home], 1)
        gain = np.where(of_probes == home, 0.0, enter + leave)
        found = computed.found
        return self.detector.detect(cloud_of_xyzi(view.points)) if found is None else found, gain

    def _step(self, probability: float) -> None:
        """Move to the place of the highest mean gain, if it has one, with this probability."""
        best = np.argmax(self.gain, axis=0)
        worth = self.gain[best, np.arange(len(best))]  # 0 where none is known
        goes = (worth > 0) & (self.rng.random(len(best)) < probability)
        goes &= self.focus.is_open[self.owner[self.movable]]
        self.choice = np.where(goes, best, self.choice)
        if self.rules.constraints.max_points is not None:
            of_points = np.zeros(len(self.points))
            of_points[self.movable] = np.where(self.choice > 0, np.maximum(worth, 1e-12), 0.0)
            self.choice[~self.rules.limit(of_points)[self.movable]] = 0


def _ways() -> list[Float64]:
    """To stay, and the directions to the 26 neighbours of a cube."""
    steps = [np.array(step, np.float64) for step in itertools.product((-1, 0, 1), repeat=3)]
    return sorted((step / max(1.0, math.sqrt(step @ step)) for step in steps), key=lambda way: way @ way)
