"""Random addition of points near objects, as an allocation problem: which places near each get a point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.greedy_allocation import greedy_allocation
from advpipe.pipeline.adversary.places import Places
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_POINTS_PER_OBJECT = 60
"""The most points of one object during the search; a ghost object may take all places."""

KEPT_CANDIDATES, NEW_CANDIDATES = 300, 500
"""Places of an object that are evaluated each round: the best of earlier rounds, and random new ones."""


@dataclass(eq=False)
class AdditionProblem:
    """The items are places; taking one adds a point there. It proposes random places.

    clean: (N, 4) float32.
    """

    clean: Float32
    places: Places
    objective: AttackObjective
    rng: np.random.Generator
    focus: Focus = field(init=False)

    def __post_init__(self) -> None:
        self._all = np.concatenate([self.clean, self.places.points])
        self.focus = Focus(self._all, self.objective.goal.targets.boxes.double().numpy())
        self._gain = np.full(len(self.places), -np.inf)
        self._pool = np.zeros(0, np.int64)

    @property
    def max_items(self) -> Int64:
        owner = self.places.owner
        goal = self.objective.goal
        available = np.bincount(owner[owner >= 0], minlength=len(goal.targets))
        return available if goal.aim == "create" else np.minimum(available, MAX_POINTS_PER_OBJECT)

    @property
    def clean_values(self) -> Float64:
        return self.objective.clean_values

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        points, shown = self.seen(taken)
        if not will_propose:
            return self.objective.value(self.objective.detector.detect(cloud_of_xyzi(points)))
        self.refill_pool(taken)
        found, self._gain[self._pool] = self.assessed(points, shown)
        return self.objective.value(found)

    def refill_pool(self, taken: Int64) -> None:
        """Choose the places that are assessed next, of those not taken, for each open object."""
        free = np.ones(len(self.places), bool)
        free[taken] = False
        pools = [
            self._choose(np.flatnonzero(free & (self.places.owner == number)))
            for number in np.flatnonzero(self.focus.is_open)
        ]
        self._pool = np.concatenate([np.zeros(0, np.int64), *pools])

    def seen(self, taken: Int64) -> tuple[Float32, Int64]:
        """The points (K, 4) that the detector is shown with these places taken; and which of the clean
        points and places they are."""
        is_there = np.arange(len(self._all)) < len(self.clean)
        is_there[len(self.clean) + taken] = True
        shown = self.focus.shown[is_there[self.focus.shown]]
        return self._all[shown], shown

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        del taken, room
        proposals = []
        for number, count in enumerate(wanted):
            mine = self._pool[self.places.owner[self._pool] == number] if count else np.zeros(0, np.int64)
            best = mine[np.argsort(-self._gain[mine], kind="stable")[:count]]
            proposals.append(best[self._gain[best] > 0])
        return proposals

    def evaluate(self, taken: Int64) -> Float64:
        return self.objective(np.concatenate([self.clean, self.places.points[taken]]))

    def is_satisfied(self, values: Float64) -> Bool:
        return self.objective.is_satisfied(values)

    def _choose(self, mine: Int64) -> Int64:
        """The places of an object to evaluate in this round."""
        known = np.isfinite(self._gain[mine])
        best = mine[known][np.argsort(-self._gain[mine[known]], kind="stable")[:KEPT_CANDIDATES]]
        fresh = self.rng.permutation(mine[~known])[
            : NEW_CANDIDATES if known.any() else KEPT_CANDIDATES + NEW_CANDIDATES
        ]
        return np.concatenate([best, fresh])

    def assessed(self, points: Float32, shown: Int64) -> tuple[Detections, Float64]:
        """What the detector finds in these points, (K, 4), the clean ones and places `shown`, (K,); and
        the estimated gain of one more at each place of the pool."""
        del shown
        found = self.objective.detector.detect(cloud_of_xyzi(points))
        return found, self.rng.random(len(self._pool)) + 1e-9


def add_greedily(problem: AdditionProblem, count: int, tries: int) -> Places:
    """At most `count` places, allocated to the objects greedily; fewer if no others help."""
    return problem.places[np.concatenate(greedy_allocation(problem, count, tries))[:count]]
