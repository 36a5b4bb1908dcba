"""The search that `detach` and `attach` share: what each object costs, and which objects are worth it.

Objects hardly touch one another, so one pass of the detector serves all of them at once: round by round
every object that is still found loses (or gets) a few more points, and the detector says what each of these
rungs did to it. Then the budget is spent on the rungs that do the most harm together.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.stages.attack.lidar.selection import NoGradientError

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

GROWTH_POWER = 1.5
"""The goals of the rounds grow with this power: fine first steps, for the objects that fall early."""

MAX_REVISIONS = 3
"""How often a choice of rungs is looked at together, and what did not hold is priced anew."""


class AllocationProblem(Protocol):
    """What is played for, with items that cost one point each."""

    @property
    def most(self) -> Int64:
        """How many items each object (M,) may take at most."""

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        """For each object its next items, the most harmful first, given all that is taken; about as many
        as `wanted` (M,), none where that is 0, never more than `room` (M,), and none that is taken."""

    def harm(self, taken: Int64) -> Float64:
        """What the objects (M,) suffer from the items taken."""

    def enough(self, harm: Float64) -> Bool:
        """Which objects (M,) need no more items."""


def queries(rounds: int) -> int:
    """How many choices of items the detector judges in so many rounds."""
    return rounds + MAX_REVISIONS


def greedy_allocation(game: AllocationProblem, budget: int, rounds: int) -> tuple[Int64, Int64]:
    """The items, at most `budget`, that do the most harm found in so many rounds; and the others that were
    tried, in the order in which they would go on. Raises NoGradientError where not even the first round
    has a gradient to follow."""
    depth = np.minimum(game.most, budget)
    harm = game.harm(np.zeros(0, np.int64))
    objects = [ObjectCosts(value) for value in harm]
    hopeless = game.enough(harm).all()  # nothing was found in the first place: follow the gradient once
    for round_ in range(1, rounds + 1):
        goals = np.ceil(depth * (round_ / rounds) ** GROWTH_POWER).astype(np.int64)
        taken = np.array([len(object_.items) for object_ in objects], np.int64)
        wanted = np.where(game.enough(harm), 0, np.maximum(goals - taken, 0))
        if hopeless:
            wanted = depth if round_ == 1 else np.zeros_like(depth)
        if not wanted.any():
            continue
        try:
            proposals = game.propose(_all_items(objects), wanted, depth - taken)
        except NoGradientError:
            if not any(object_.items for object_ in objects):
                raise
            break  # what was found so far stays
        if not any(map(len, proposals)):
            break
        for object_, items in zip(objects, proposals, strict=True):
            object_.items.extend(items.tolist())
        harm = game.harm(_all_items(objects))
        for object_, value in zip(objects, harm, strict=True):
            object_.end_round(value)
    chosen = _best_together(game, objects, budget)
    return chosen, np.setdiff1d(_all_items(objects), chosen, assume_unique=True)


class ObjectCosts:
    """The items of one object in the order in which it took them, and what it suffered at each rung."""

    def __init__(self, harm: float) -> None:
        self.items: list[int] = []
        self.cost, self.harm = [0], [float(harm)]

    def end_round(self, harm: float) -> None:
        """A round is over. Without new items the object only suffers from its neighbours', for free."""
        if len(self.items) > self.cost[-1]:
            self.cost.append(len(self.items))
            self.harm.append(float(harm))

    def up_to(self, rung: int) -> list[int]:
        return self.items[: self.cost[rung]]


def allocate(costs: list[list[int]], harms: list[list[float]], budget: int) -> list[int]:
    """The rung of each object that together cost at most `budget` and do the most harm.

    The multiple-choice knapsack, solved exactly by dynamic programming; of equal choices a cheaper one.
    """
    best, chosen = np.zeros(budget + 1), []
    for cost, harm in zip(costs, harms, strict=True):
        options = np.full((len(cost), budget + 1), -np.inf)
        for rung, (price, gain) in enumerate(zip(cost, harm, strict=True)):
            if price <= budget:
                options[rung, price:] = best[: budget + 1 - price] + gain - harm[0]
        chosen.append(np.argmax(options, axis=0))
        best = options.max(axis=0)
    rungs, left = [], int(np.argmax(best))
    for cost, choice in zip(reversed(costs), reversed(chosen), strict=True):
        rungs.append(int(choice[left]))
        left -= cost[rungs[-1]]
    return rungs[::-1]


def _best_together(game: AllocationProblem, objects: list[ObjectCosts], budget: int) -> Int64:
    """The best choice of rungs, looked at together: neighbours may have helped each other on the way up."""
    best, most = np.zeros(0, np.int64), -np.inf
    costs, harms = [object_.cost for object_ in objects], [list(object_.harm) for object_ in objects]
    for _ in range(MAX_REVISIONS):
        rungs = allocate(costs, harms, budget)
        items = np.array(
            [i for object_, r in zip(objects, rungs, strict=True) for i in object_.up_to(r)], int
        )
        harm = game.harm(items)
        if harm.sum() > most:
            best, most = items, float(harm.sum())
        fell_short = [r > 0 and harms[m][r] > harm[m] + 1e-9 for m, r in enumerate(rungs)]
        if not any(fell_short):
            break
        for m, (rung, short) in enumerate(zip(rungs, fell_short, strict=True)):
            if short:
                harms[m][rung] = float(harm[m])
    return best


def _all_items(objects: list[ObjectCosts]) -> Int64:
    return np.array([item for object_ in objects for item in object_.items], np.int64)
