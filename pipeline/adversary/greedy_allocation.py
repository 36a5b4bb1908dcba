"""Greedy allocation of a budget of points to objects, by `detach`, `attach` and the random baseline.

Objects hardly affect each other, so one pass of the detector evaluates all of them at once. In each round
every object that is still found loses (or gets) a few more points, and the detector shows the effect of this
level; an object that is lost gets back a part of its last step, so that the budget lasts for others. Then the
budget is spent on the levels with the highest total objective.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.gradient import NoGradientError

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

GROWTH_POWER = 1.5
"""The number of items grows with this power of the round: small first steps, for easily lost objects."""

MAX_REVISIONS = 3
"""How often a combination of levels is evaluated and the values that did not hold are corrected."""


LINE_SEARCH = 3
"""How often a lost object tries fewer items, each time half-way between too few and enough."""


class AllocationProblem(Protocol):
    """Objects whose objective rises with the items chosen for them; each item costs one point."""

    @property
    def max_items(self) -> Int64:
        """The most items that each object (M,) may take."""

    @property
    def clean_values(self) -> Float64:
        """The objective (M,) of the objects with nothing taken."""

    @property
    def focus(self) -> Focus:
        """The objects that are still looked at."""

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        """The objective (M,) of the objects with these items taken, valid for open ones alone; higher is
        better for the attacker. will_propose: `propose` follows for these items."""

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        """The next items of each object, the most effective first, given the items already taken and looked
        at: about `wanted` (M,) of them, none where that is 0, never more than `room` (M,), and none taken."""

    def evaluate(self, taken: Int64) -> Float64:
        """The objective (M,) of all objects with these items taken, in the whole cloud."""

    def is_satisfied(self, values: Float64) -> Bool:
        """Which objects (M,) need no more items, by their objective."""


class ObjectOptions(Protocol):
    """What one object may be given, at which cost and objective: first nothing, for its clean objective."""

    values: list[float]

    @property
    def cost(self) -> list[int]: ...

    def up_to(self, level: int) -> list[int]:
        """The items of a level."""


def queries(rounds: int) -> int:
    """How many candidates the detector evaluates in this many rounds."""
    return rounds + MAX_REVISIONS


def greedy_allocation(problem: AllocationProblem, budget: int, tries: int) -> tuple[Int64, Int64]:
    """At most `budget` items with the highest total objective found; and the other items that were tried, in
    order.

    tries: how many candidates are evaluated at most, 2 or more: `MAX_REVISIONS` of them, or all but one,
    evaluate combinations. Raises NoGradientError if there is no gradient in the first round.
    """
    revisions = min(MAX_REVISIONS, tries - 1)
    rounds = tries - revisions
    depth = np.minimum(problem.max_items, budget)
    values = problem.clean_values
    objects = [ObjectCosts(value) for value in values]
    # The detector finds nothing in the clean cloud: follow the gradient once.
    is_solved = problem.is_satisfied(values).all()
    if not is_solved:
        problem.focus.close(problem.is_satisfied(values))
    problem.look(_all_items(objects), will_propose=True)
    for round_ in range(1, rounds + 1):
        goals = np.ceil(depth * (round_ / rounds) ** GROWTH_POWER).astype(np.int64)
        taken = np.array([len(object_.items) for object_ in objects], np.int64)
        wanted = np.where(problem.is_satisfied(values), 0, np.maximum(goals - taken, 0))
        if is_solved:
            wanted = depth if round_ == 1 else np.zeros_like(depth)
        searching = [object_.halve() for object_ in objects]
        if not (wanted.any() or any(searching)):
            continue
        try:
            if not _extend(problem, objects, wanted, depth - taken) and not any(searching):
                break
        except NoGradientError:
            if not any(object_.items for object_ in objects):
                raise
            break  # keep what was found so far
        seen = problem.look(_tried_items(objects), will_propose=round_ < rounds)
        values = _end_round(problem, objects, values, seen)
    chosen = best_together(problem, objects, budget, revisions)
    return chosen, np.setdiff1d(_all_items(objects), chosen, assume_unique=True)


class ObjectCosts:
    """The items of one object, in order, and its cost and objective at each level, from few items to many.

    tried: how many of the items the next look shows.
    """

    def __init__(self, value: float) -> None:
        self.items: list[int] = []
        self.cost, self.values = [0], [float(value)]
        self.tried = 0
        self._bounds, self._halvings = (0, 0), 0

    def extend(self, items: list[int]) -> None:
        """Take these, too."""
        if items:
            self.items += items
            self.tried = len(self.items)

    def start_line_search(self) -> None:
        """All items are enough, and those of the level before were too few: try what lies between."""
        self._bounds, self._halvings = (
            (self.cost[-2] if len(self.cost) > 1 else 0, len(self.items)),
            LINE_SEARCH,
        )

    def halve(self) -> bool:
        """Try half-way between too few and enough items next. Returns whether there is something to try."""
        few, enough = self._bounds
        if self.is_searching:
            self.tried = (few + enough) // 2
        return self.is_searching

    @property
    def is_searching(self) -> bool:
        """Whether it is lost, and tries fewer items."""
        few, enough = self._bounds
        return self._halvings > 0 and enough - few > 1

    def end_round(self, value: float, *, is_satisfied: bool) -> None:
        """Add a level if the object tried another number of items; otherwise only its neighbours' items
        affected it."""
        was_searching = self.is_searching
        if was_searching:
            few, enough = self._bounds
            self._bounds = (few, self.tried) if is_satisfied else (self.tried, enough)
            self._halvings -= 1
        if self.tried not in self.cost:
            place = bisect(self.cost, self.tried)
            self.cost.insert(place, self.tried)
            self.values.insert(place, float(value))
        if was_searching and not self.is_searching:
            self.tried = self._bounds[1]

    def up_to(self, level: int) -> list[int]:
        """The items that bring the object to a level."""
        return self.items[: self.cost[level]]


def allocate(costs: list[list[int]], all_values: list[list[float]], budget: int) -> list[int]:
    """The level of each object with the highest total objective and a total cost of at most `budget`.

    The multiple-choice knapsack, solved exactly by dynamic programming; ties go to a cheaper choice.
    """
    best, chosen = np.zeros(budget + 1), []
    for cost, values in zip(costs, all_values, strict=True):
        options = np.full((len(cost), budget + 1), -np.inf)
        for level, (price, gain) in enumerate(zip(cost, values, strict=True)):
            if price <= budget:
                options[level, price:] = best[: budget + 1 - price] + gain - values[0]
        chosen.append(np.argmax(options, axis=0))
        best = options.max(axis=0)
    levels, left = [], int(np.argmax(best))
    for cost, choice in zip(reversed(costs), reversed(chosen), strict=True):
        levels.append(int(choice[left]))
        left -= cost[levels[-1]]
    return levels[::-1]


def best_together(
    problem: AllocationProblem, objects: Sequence[ObjectOptions], budget: int, revisions: int
) -> Int64:
    """The best combination of levels, evaluated together: an object may depend on its neighbours' items."""
    best, most = np.zeros(0, np.int64), -np.inf
    costs, all_values = [object_.cost for object_ in objects], [list(object_.values) for object_ in objects]
    for _ in range(revisions):
        levels = allocate(costs, all_values, budget)
        items = np.array(
            [i for object_, r in zip(objects, levels, strict=True) for i in object_.up_to(r)], int
        )
        values = problem.evaluate(items)
        if values.sum() > most:
            best, most = items, float(values.sum())
        fell_short = [r > 0 and all_values[m][r] > values[m] + 1e-9 for m, r in enumerate(levels)]
        if not any(fell_short):
            break
        for m, (level, short) in enumerate(zip(levels, fell_short, strict=True)):
            if short:
                all_values[m][level] = float(values[m])
    return best


def _extend(problem: AllocationProblem, objects: Sequence[ObjectCosts], wanted: Int64, room: Int64) -> bool:
    """Give objects their next items. Returns whether there were any. Raises NoGradientError."""
    if not wanted.any():
        return False
    proposals = problem.propose(_all_items(objects), wanted, room)
    for object_, items in zip(objects, proposals, strict=True):
        object_.extend(items.tolist())
    return any(map(len, proposals))


def _end_round(
    problem: AllocationProblem, objects: Sequence[ObjectCosts], values: Float64, seen: Float64
) -> Float64:
    """The objective (M,) after a look that showed these values: of a lost object that of all its items."""
    lost, was_lost = problem.is_satisfied(seen), problem.is_satisfied(values)
    known = values.copy()
    for number in np.flatnonzero(problem.focus.is_open).tolist():
        object_, was_searching = objects[number], objects[number].is_searching
        object_.end_round(float(seen[number]), is_satisfied=bool(lost[number]))
        if not was_searching:
            known[number] = seen[number]
            if lost[number] and not was_lost[number]:
                object_.start_line_search()
    problem.focus.close(np.array([not each.is_searching for each in objects]) & problem.is_satisfied(known))
    return known


def _tried_items(objects: Sequence[ObjectCosts]) -> Int64:
    return np.array([item for object_ in objects for item in object_.items[: object_.tried]], np.int64)


def _all_items(objects: Sequence[ObjectCosts]) -> Int64:
    return np.array([item for object_ in objects for item in object_.items], np.int64)
