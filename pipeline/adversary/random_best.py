"""The random baseline `random-best`: as many judged tries as an attack, chosen among and allocated as there.

Recipe `random-best` of the attacks and the baseline of an evaluation are both made here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.addition_problem import AdditionProblem, add_greedily
from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.constraints import Constraints, Rules
from advpipe.pipeline.adversary.copied_intensities import copied_intensities
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal, goal_of, known_boxes, owners, with_decoys
from advpipe.pipeline.adversary.per_object_best import PerObjectBest
from advpipe.pipeline.adversary.places import (
    Places,
    ball_places,
    joined,
    no_places,
    with_drawn_intensities,
)
from advpipe.pipeline.adversary.random_search import RandomSearch
from advpipe.pipeline.adversary.removal_problem import RemovalProblem, remove_greedily
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import Cloud, cloud_of_xyzi, xyz, xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

MARGIN_M = 0.5
"""Points and new places this near to an object belong to it: detectors use its surroundings, too."""

MOVE_MARGIN_M = 1.0
"""Points this near to an object may be moved for it."""

PLACES_PER_POINT = 200
"""Random candidate places per added point."""

REST_M = 0.02
"""Points without any effect are added this near to clean ones, so that the cloud hardly changes."""


@dataclass(frozen=True)
class RandomBest:
    """Random changes of a cloud of points (N, 4), all finite, with the best of `tries` for each object.

    One of the tries is the combination of the best changes; of removed and added points several may be. One
    try alone is not judged: it is a random change near objects.
    """

    points: Float32
    goal: AttackGoal
    detector: ObjectDetector
    rules: Rules
    tries: int
    rng: np.random.Generator

    def removed(self, count: int) -> Int64:
        """The indices of `count` points to remove, near objects first; fewer if the rules allow no more."""
        allowed = np.flatnonzero(self.rules.allowed)
        count = min(count, len(allowed))
        owner = np.full(len(self.points), -1, np.int64)
        owner[allowed] = owners(self.points[allowed, :3], self._objects, MARGIN_M)
        if self.tries == 1:
            near = self.rng.permutation(np.flatnonzero(owner >= 0))[:count]
            rest = np.setdiff1d(allowed, near, assume_unique=True)
            return np.concatenate([near, self.rng.choice(rest, size=count - len(near), replace=False)])
        problem = RemovalProblem(self.points, owner, self._objective, self.rng)
        return remove_greedily(problem, allowed, count, self.tries)[0]

    def added(self, count: int, reach_m: float) -> Places:
        """`count` places of new points, each within the reach of a clean one; fewer if the rules permit
        hardly any. Attacked intensities are drawn uniformly over those of the cloud."""
        sources = addition_sources(self.points, self._objects, self.rules)
        if self.tries == 1:
            return self._with_intensity(self._places(sources, count, reach_m))
        places = self._with_intensity(self._places(sources, PLACES_PER_POINT * count, reach_m))
        problem = AdditionProblem(self.points, places, self._objective, self.rng)
        best = add_greedily(problem, count, self.tries)
        rest = self._places(sources, count - len(best), min(reach_m, REST_M))
        return joined([best, rest])

    def moved(self, reach_m: float) -> Float32:
        """The points (N, 4), those near objects moved by the whole reach, as far as the rules allow."""
        owner = owners(self.points[:, :3], self.goal.regions, MOVE_MARGIN_M)
        search = RandomSearch(self.points, self.rules, owner >= 0, reach_m, self.rng)
        if self.tries == 1:
            return next(search.candidates(1))
        found, focus = self.detector.detect(cloud_of_xyzi(self.points)), Focus(self.points, self.goal.regions)
        most = self.rules.constraints.max_points
        best = PerObjectBest(self.goal, self.detector, self.points, found, owner, focus, self.tries, most)
        for candidate in search.candidates(best.candidates):
            best.update(candidate)
        return best.combined()

    @property
    def _objects(self) -> Float64:
        boxes: Float64 = self.goal.targets.boxes.double().numpy()
        return boxes

    @property
    def _objective(self) -> AttackObjective:
        return AttackObjective.of(self.goal, self.detector, self.points)

    def _places(self, sources: Int64, count: int, reach_m: float) -> Places:
        boxes = self._objects
        return ball_places(self.points, sources, count, boxes, self.rules, reach_m, MARGIN_M, self.rng)

    def _with_intensity(self, places: Places) -> Places:
        if not self.rules.constraints.intensity:
            return places
        return with_drawn_intensities(places, self.points, self.rng)


def addition_sources(points: Float32, boxes: Float64, rules: Rules) -> Int64:
    """The points (N, 4) that new ones start from: those near boxes (M, 7) that the rules allow, or all
    allowed ones if there are none."""
    near = np.flatnonzero((owners(points[:, :3], boxes, MARGIN_M) >= 0) & rules.allowed)
    return near if len(near) else np.flatnonzero(rules.allowed)


@dataclass(frozen=True)
class RandomBudget:
    """What an attack spent on a cloud: points removed and added; how far a new point may lie from the one
    that it starts at; how far points may move, 0 where none did; and whether intensities changed."""

    removed: int
    added: int
    added_reach_m: float
    moved_reach_m: float
    changes_intensity: bool = False

    @property
    def changes(self) -> int:
        """In how many ways it changes a cloud; each gets its part of the tries."""
        return bool(self.removed) + bool(self.added) + bool(self.moved_reach_m or self.changes_intensity)


def random_best(
    cloud: Cloud,
    boxes: Boxes,
    detector: ObjectDetector,
    constraints: Constraints,
    budget: RandomBudget,
    *,
    tries: int,
    rng: np.random.Generator,
) -> Cloud:
    """A cloud (N,) under random changes of this budget, the best of so many tries for each object.

    As it was where nothing was spent, or where there is no object that the attack could target.
    """
    finite = np.flatnonzero(np.isfinite(xyzi(cloud)).all(axis=1))
    if not budget.changes or not len(finite):
        return cloud.copy()
    constraints = replace(constraints, intensity=constraints.intensity or budget.changes_intensity)
    scene = cloud[finite]
    boxes = known_boxes(constraints, detector, scene, boxes)
    goal, rules = goal_of(constraints, detector, scene, boxes), Rules(constraints, xyz(scene), boxes)
    if not len(goal.targets):
        return cloud.copy()
    random = RandomBest(xyzi(scene), goal, detector, rules, max(1, tries // budget.changes), rng)
    changed = cloud.copy()
    if budget.moved_reach_m or budget.changes_intensity:
        decoyed = goal if random.tries == 1 else with_decoys(goal, detector.detect(scene), boxes)
        moved = replace(random, goal=decoyed).moved(budget.moved_reach_m)
        for column, name in enumerate(("x", "y", "z", "intensity")):
            changed[name][finite] = moved[:, column]
    removed = finite[random.removed(budget.removed)] if budget.removed else finite[:0]
    new = random.added(budget.added, budget.added_reach_m) if budget.added else no_places()
    added = scene[new.source]
    for column, name in enumerate(("x", "y", "z", "intensity")):
        added[name] = new.points[:, column]
    if not constraints.intensity:
        added["intensity"] = copied_intensities(scene["intensity"], new.source)
    return np.concatenate([np.delete(changed, removed), added])
