"""Score-based search for the fewest items that lose each object, of detectors known by their output alone.

Objects hardly affect each other, so each pass of the detector is a trial for every one of them. A trial is a
subset of the object's items (points to remove, or places to add one), new or made from the best one so far.
Subsets grow until the object is lost, and shrink from then on. Then the budget is spent on the subsets with
the highest total objective. The gradient of the loss is only one of the `item_orders`, so that a poor one
costs little.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.adaptive_choice import AdaptiveChoice
from advpipe.pipeline.adversary.greedy_allocation import (
    GROWTH_POWER,
    MAX_REVISIONS,
    AllocationProblem,
    best_together,
)
from advpipe.pipeline.adversary.item_orders import NEEDS_GRADIENT, ORDERS, ordered

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

FULL_SIZE_AT = 0.8
"""Growing subsets reach their full size after this share of the trials."""

SHRINK = 0.6
"""The next trial of a lost object is smaller by this factor, which gets closer to 1 with each failure."""

FROM_BEST = 0.5
"""The probability of a trial made from the best one so far."""


class SubsetProblem(AllocationProblem, Protocol):
    """An allocation problem whose items may be taken in any combination."""

    @property
    def item_xyz_m(self) -> Float64:
        """Where the items are, (K, 3)."""

    @property
    def item_owner(self) -> Int64:
        """The object that each item (K,) belongs to, -1 for none."""

    @property
    def is_inside(self) -> Bool:
        """Which items (K,) lie in an object's box."""

    @property
    def item_gains(self) -> Float64:
        """The gain of each item (K,) by the gradient of the latest look that proposes; all 0 if there is
        none."""


class ObjectTrials:
    """The subsets tried on one object, with their objectives; the first is nothing, in the clean cloud."""

    def __init__(self, clean_value: float) -> None:
        self.subsets, self.values = [np.zeros(0, np.int64)], [clean_value]
        self.best, self.is_lost, self.shrink = 0, False, SHRINK

    @property
    def cost(self) -> list[int]:
        return [len(subset) for subset in self.subsets]

    def up_to(self, level: int) -> list[int]:
        """The items of one trial."""
        items: list[int] = self.subsets[level].tolist()
        return items

    @property
    def best_subset(self) -> Int64:
        """The smallest that loses the object, else the one of the highest objective."""
        return self.subsets[self.best]

    def record(self, subset: Int64, value: float, *, is_lost: bool) -> bool:
        """Add a trial. Returns whether it is the best so far."""
        if self.is_lost:
            is_better = is_lost and len(subset) < len(self.best_subset)
            self.shrink = SHRINK if is_better else (1 + self.shrink) / 2
        else:
            is_better = is_lost or value > self.values[self.best] + 1e-9
        self.subsets.append(subset)
        self.values.append(value)
        if is_better:
            self.best, self.is_lost = len(self.values) - 1, is_lost
        return is_better


class SubsetSearch:
    """The search on one cloud."""

    def __init__(self, problem: SubsetProblem, rng: np.random.Generator) -> None:
        self.problem, self.rng = problem, rng
        self.choice = AdaptiveChoice(len(ORDERS), rng)

    def allocation(self, budget: int, tries: int) -> Int64:
        """At most `budget` items with the highest total objective found.

        What the trials leave of the budget goes to the items of the highest gains by the gradient, near
        objects that are not lost. tries: how many candidates are evaluated at most, 2 or more, combinations
        included (`greedy_allocation`).
        """
        problem, clean = self.problem, self.problem.clean_values
        revisions = min(MAX_REVISIONS, tries - 1)
        depth = np.minimum(problem.max_items, budget)
        trials = [ObjectTrials(value) for value in clean.tolist()]
        targets = ~problem.is_satisfied(clean)
        if targets.any():
            problem.focus.close(~targets)
        problem.look(np.zeros(0, np.int64), will_propose=True)
        if not targets.any():  # the detector finds nothing in the clean cloud: follow the gradient
            return self._by_gradient(np.zeros(0, np.int64), ~targets, budget)
        self._try_subsets(trials, targets & (depth > 0), depth, tries - revisions)
        chosen = best_together(problem, trials, budget, revisions)
        return self._by_gradient(chosen, targets & ~np.array([each.is_lost for each in trials]), budget)

    def _try_subsets(self, trials: list[ObjectTrials], is_open: Bool, depth: Int64, rounds: int) -> None:
        """`rounds` trials of every open object; fewer once each is lost with one item."""
        problem, owner = self.problem, self.problem.item_owner
        items = {number: np.flatnonzero(owner == number) for number in np.flatnonzero(is_open).tolist()}
        for round_ in range(1, rounds + 1):
            drawn = {}
            for number in np.flatnonzero(is_open).tolist():
                share = min(1.0, round_ / (FULL_SIZE_AT * rounds)) ** GROWTH_POWER
                order = self.choice.draw(~NEEDS_GRADIENT | bool(problem.item_gains[items[number]].any()))
                size = math.ceil(share * depth[number])
                drawn[number] = order, self._subset(trials[number], items[number], size, order)
            if not drawn:
                break
            taken = np.concatenate([subset for _, subset in drawn.values()])
            values = problem.look(taken, will_propose=round_ < rounds)
            is_lost = problem.is_satisfied(values)
            for number, (order, subset) in drawn.items():
                lost = bool(is_lost[number])
                is_better = trials[number].record(subset, float(values[number]), is_lost=lost)
                self.choice.learn(order, is_success=is_better)
                is_open[number] = not (lost and len(subset) == 1)
            problem.focus.close(~is_open)

    def _subset(self, trials: ObjectTrials, items: Int64, size: int, order: int) -> Int64:
        """The next subset to try on an object, of its items (K,): of this size, or less once it is lost."""
        best, is_from_best = trials.best_subset, self.rng.random() < FROM_BEST
        if trials.is_lost:
            size = max(1, min(len(best) - 1, math.ceil(trials.shrink * len(best))))
            return self._ordered(best if is_from_best else items, order)[:size]
        if is_from_best and len(best) < size:
            others = np.setdiff1d(items, best, assume_unique=True)
            return np.concatenate([best, self._ordered(others, order)[: size - len(best)]])
        return self._ordered(items, order)[:size]

    def _ordered(self, items: Int64, order: int) -> Int64:
        problem = self.problem
        return ordered(items, order, problem.item_xyz_m, problem.item_gains, problem.is_inside, self.rng)

    def _by_gradient(self, chosen: Int64, objects: Bool, budget: int) -> Int64:
        """The chosen items and, up to the budget, those of the highest gains near these objects (M,)."""
        is_near = np.append(objects, False)[self.problem.item_owner]
        gain = np.where(is_near, self.problem.item_gains, 0.0)
        gain[chosen] = 0
        others = np.argsort(-gain, kind="stable")[: budget - len(chosen)]
        return np.concatenate([chosen, others[gain[others] > 0]])
