"""Random addition of points near objects, as an allocation problem: which places near each get a point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.greedy_allocation import greedy_allocation
from advpipe.pipeline.adversary.per_object_best import jittered
from advpipe.pipeline.adversary.places import Places

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_POINTS_PER_OBJECT = 60
"""The most points of one object during the search; a ghost object may take all places."""

KEPT_CANDIDATES, NEW_CANDIDATES = 300, 500
"""Places of an object that are evaluated each round: the best of earlier rounds, and random new ones."""


@dataclass(frozen=True)
class AdditionProblem:
    """The items are places; taking one adds a point there. It proposes random places.

    clean: (N, 4) float32. jitter_m: standard deviation of the noise for proposals and evaluations; 0 for
    none.
    """

    clean: Float32
    places: Places
    objective: AttackObjective
    rng: np.random.Generator
    jitter_m: float = 0.0
    _gain: Float64 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_gain", np.full(len(self.places), -np.inf))

    @property
    def max_items(self) -> Int64:
        owner = self.places.owner
        goal = self.objective.goal
        available = np.bincount(owner[owner >= 0], minlength=len(goal.targets))
        return available if goal.aim == "create" else np.minimum(available, MAX_POINTS_PER_OBJECT)

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        free = np.ones(len(self.places), bool)
        free[taken] = False
        pools = [self._pool(np.flatnonzero(free & (self.places.owner == m))) for m in np.flatnonzero(wanted)]
        pool = np.concatenate([np.zeros(0, np.int64), *pools])
        if len(pool):
            self._gain[pool] = self.gains(taken, pool)
        proposals = []
        for number, count in enumerate(wanted):
            mine = pool[self.places.owner[pool] == number] if count else np.zeros(0, np.int64)
            best = mine[np.argsort(-self._gain[mine], kind="stable")[:count]]
            proposals.append(best[self._gain[best] > 0])
        return proposals

    def evaluate(self, taken: Int64) -> Float64:
        return self.objective(self.with_added(taken))

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

    def gains(self, taken: Int64, pool: Int64) -> Float64:
        """The estimated gain (K,) of a point at each place of the pool, beside those taken."""
        del taken
        return self.rng.random(len(pool)) + 1e-9

    def with_added(self, taken: Int64) -> Float32:
        """The clean points, and those at the taken places, under the noise."""
        points = np.concatenate([self.clean, self.places.points[taken]])
        return jittered(points, self.jitter_m, self.rng)


def add_greedily(problem: AdditionProblem, count: int, tries: int) -> Places:
    """At most `count` places, allocated to the objects greedily; fewer if no others help."""
    return problem.places[np.concatenate(greedy_allocation(problem, count, tries))[:count]]
