"""Detachment: hide objects by removing a small fraction of a cloud's points."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.black_box import as_seen_by, told_by
from advpipe.pipeline.adversary.constraints import BLACK_BOX, GOALS, TRUTHS, Constraints, Rules
from advpipe.pipeline.adversary.expectation import EXPECTATIONS
from advpipe.pipeline.adversary.expected_objective import ExpectedObjective
from advpipe.pipeline.adversary.goal import goal_of, known_boxes, owners
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.greedy_allocation import greedy_allocation, queries
from advpipe.pipeline.adversary.missing_returns import MissingReturnLimit
from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.adversary.random_best import MARGIN_M, RandomBest
from advpipe.pipeline.adversary.removal_problem import remove_greedily, with_random_rest
from advpipe.pipeline.adversary.subset_search import SubsetSearch
from advpipe.pipeline.adversary.targets import AttackTargets, look
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.baselines import random_points
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.no_detector import NoDetector
from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import POINTS_ADDED, POINTS_MOVED, SHARE_REMOVED
from advpipe.pipeline.messages.cloud import Cloud, chosen_points, is_finite, xyz, xyzi
from advpipe.stages.attack.bounds import checked_choice, checked_integer
from advpipe.stages.attack.lidar.base import (
    MAX_ROUNDS,
    NO_GRADIENT,
    PROPOSING,
    QUERIES,
    QUERYING,
    STEPPING,
    WITH_GOAL,
    Budget,
    LidarAttack,
    LidarResult,
    LidarTraits,
    PublishedFigure,
    search_note,
    unchanged,
)
from advpipe.stages.attack.lidar.detach_problem import DetachProblem
from advpipe.stages.attack.lidar.loss_problems import LossRemovalProblem
from advpipe.stages.attack.lidar.robust_detach import RobustDetachProblem
from advpipe.stages.attack.lidar.selection import Indices, choose_salient_points
from advpipe.stages.attack.lidar.stealthy import NO_RINGS, StealthyDetachProblem

RECIPES = (
    "best",
    "hide",
    "robust",
    "stealthy",
    "transfer",
    "paper",
    "score-based",
    "decision-based",
    "random",
    "random-near",
    "random-best",
)


@dataclass(kw_only=True, eq=False)
class Detach(LidarAttack):
    """Remove exactly round(ratio * N) of a cloud's N points.

    The attacker knows the detector, the true boxes (or its detections, `truth`) and the rule that matches
    detections to them (`goal`).

    ratio: the fraction to remove, in (0, 1). Halves round up; at least one point is removed, and one stays.
        Points that are not finite (rays without an echo, in some drivers) do not count and stay.
    recipe: "best" empties the voxels that the detector needs, evaluates the detections, and spends the budget
        on the objects that are lost with the fewest points; for a detector without `occupancy_loss`, it
        searches such points by the detections (`subset_search`), the shipped detector's among them; "hide" is
        "best" with the goal to hide: no box that overlaps an object loosely is left; "robust" takes gains and
        objective as means over draws of defences (`expectation`), a pass for each of four; "transfer"
        likewise over other views of the scene, to hold on other detectors; "stealthy" removes at most so many
        points, and in no window of rays so many that the density check of `evaluate` notices; "score-based"
        and "decision-based" are black-box attacks: they see detections alone, the second no scores
        (`black_box`), and search (`subset_search`) points of the objects that are detected in the clean
        cloud; "paper" is the greedy gradient-norm saliency of the paper (section III-A, Eq. 3). Random
        baselines of equal budget: "random" anywhere, "random-near" near objects, "random-best" there with the
        selection of "best": the baseline that reports compare the attack with.
    rounds: the remaining points are ranked again after each round (the paper: 10).
    queries: how many detections the black-box recipes ask for.
    near_objects_m, goal, truth, objects, max_points: see `constraints.Constraints`.
    """

    traits = LidarTraits(
        budget=Budget(
            title="Detachment, share removed in %",
            parameter="ratio",
            unit="%",
            scale=0.01,
            default=0.01,
            steps="rounds",
            published=(
                PublishedFigure(table_value=0.05, map_ratio_percent=99.88, chamfer_distance_m2=0.00023),
                PublishedFigure(table_value=0.1, map_ratio_percent=97.44, chamfer_distance_m2=0.00117),
                PublishedFigure(table_value=0.3, map_ratio_percent=96.71, chamfer_distance_m2=0.00921),
                PublishedFigure(table_value=0.5, map_ratio_percent=95.28, chamfer_distance_m2=0.02177),
                PublishedFigure(table_value=1.0, map_ratio_percent=91.77, chamfer_distance_m2=0.07035),
                PublishedFigure(table_value=1.5, map_ratio_percent=88.75, chamfer_distance_m2=0.13397),
            ),
        ),
        only_for={"rounds": (*STEPPING, "paper"), "queries": BLACK_BOX, "goal": WITH_GOAL},
    )

    ratio: float
    recipe: str = "best"
    rounds: int = 10
    queries: int = QUERIES
    near_objects_m: float | None = None
    goal: str = GOALS[0]
    truth: str = TRUTHS[0]
    objects: tuple[str, ...] = ()
    max_points: int | None = None

    def __post_init__(self) -> None:
        if not 0 < self.ratio < 1:
            limits = "must lie between 0 and 1, such as 0.01 for 1 %"
            raise UsageError(f"detach: ratio is {self.ratio}, but {limits}")
        checked_choice("detach", "recipe", self.recipe, RECIPES)
        self.rounds = checked_integer("detach", "rounds", self.rounds, 1, MAX_ROUNDS)
        self.queries = checked_integer("detach", "queries", self.queries, 2, MAX_ROUNDS)
        self.constraints = Constraints.among(vars(self))
        self._reports_loss = True

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {
            SHARE_REMOVED.name: (0.0, self.ratio),
            POINTS_MOVED.name: (0, 0),
            POINTS_ADDED.name: (0, 0),
            **self.constraints.bounds,
        }

    def without_losses(self) -> Detach:
        found = copy(self)
        found._reports_loss = False
        return found

    @property
    def uses_surrogate(self) -> bool:
        return self.recipe in PROPOSING

    @property
    def query_budget(self) -> int:
        return self.baseline_tries if self.recipe in QUERYING else 1

    @property
    def baseline_tries(self) -> int:
        """As many as recipe best judges; for a black-box recipe, as many as it asks for."""
        return self.queries if self.recipe in BLACK_BOX else queries(self.rounds)

    @property
    def needs_ground_truth(self) -> bool:
        return self.constraints.need_ground_truth(is_random=self.recipe == "random")

    def budget(self, points: int) -> int:
        """How many points of a cloud of this many are removed."""
        wanted = max(1, math.floor(self.ratio * points + 0.5))
        return min(wanted, self.constraints.max_points or wanted, max(points - 1, 0))

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud without the chosen points; unchanged, with a note, if there is nothing to attack."""
        finite = np.flatnonzero(is_finite(cloud))
        if self.budget(len(finite)) == 0:
            return unchanged(cloud, "no points to remove")
        scene = chosen_points(cloud, finite)
        points = xyzi(scene)
        seen = as_seen_by(self.recipe, detector)
        boxes = known_boxes(self.constraints, seen, scene, boxes)
        goal = goal_of(self.constraints, seen, scene, boxes)
        judge = detector if self._reports_loss or self.recipe != "paper" else NoDetector()
        loss_before, found = look(judge, points, goal.reported_targets)
        if not len(goal.targets) and (self.recipe != "random" or self.constraints.objects):
            return unchanged(cloud, goal.note)
        rules = Rules(self.constraints, points[:, :3], boxes)
        allowed = np.flatnonzero(rules.allowed)
        budget = min(self.budget(len(scene)), len(allowed))
        if not budget:
            return unchanged(cloud, join_notes(goal.note, "no point that may be removed"), loss_before)
        note = "" if budget == self.budget(len(scene)) else f"only {budget} points lie near enough"
        objective = AttackObjective(goal, seen, goal.success(told_by(seen, found)))
        try:
            chosen, shortage = self._choose(scene, rules, budget, objective, rng)
        except NoGradientError:
            return unchanged(cloud, join_notes(goal.note, NO_GRADIENT), loss_before)
        removed = finite[chosen]
        loss_after, _ = look(judge, np.delete(points, chosen, axis=0), goal.reported_targets)
        note = join_notes(goal.note if len(goal.targets) else "", note, shortage)
        kept = np.ones(len(cloud), bool)
        kept[removed] = False
        left = chosen_points(cloud, kept)
        return LidarResult(left, PointLabels.removed(removed), loss_before, loss_after, note)

    def _choose(
        self,
        scene: Cloud,
        rules: Rules,
        budget: int,
        objective: AttackObjective,
        rng: np.random.Generator,
    ) -> tuple[Indices, str]:
        """The `budget` points of a scene to remove, and a note for the user."""
        goal, detector = objective.goal, objective.detector
        allowed = np.flatnonzero(rules.allowed)
        if self.recipe == "random":
            return _drawn(allowed, budget, rng), ""
        if self.recipe == "paper":
            return self._greedily(scene, allowed, budget, goal.loss_targets, detector, rng)
        if self.recipe in ("random-near", "random-best"):
            random = RandomBest(xyzi(scene), goal, detector, rules, self.query_budget, rng)
            return random.removed(budget), ""
        owner = np.full(len(scene), -1, np.int64)
        owner[allowed] = owners(xyz(scene[allowed]), goal.targets.boxes.double().numpy(), MARGIN_M)
        if self.recipe == "stealthy":
            return self._stealthily(scene, owner, budget, objective, rng)
        if isinstance(detector, VoxelDetector):
            note, problem = "", DetachProblem(xyzi(scene), owner, objective, rng)
            if self.recipe in EXPECTATIONS:
                points, expectation = xyzi(scene), EXPECTATIONS[self.recipe]
                expected = ExpectedObjective.over(objective, points, expectation(points), rng)
                problem = RobustDetachProblem(points, owner, expected, rng)
            chosen, short = remove_greedily(problem, allowed, budget, self.query_budget)
        else:
            note = "" if self.recipe in BLACK_BOX else search_note(detector)
            plain = LossRemovalProblem(xyzi(scene), owner, objective, rng)
            found = SubsetSearch(plain, rng).allocation(budget, self.query_budget)
            chosen, short = with_random_rest(found, allowed, budget, rng)
        return chosen, join_notes("nothing more to gain: the rest removed at random" if short else "", note)

    def _stealthily(
        self,
        scene: Cloud,
        owner: Indices,
        budget: int,
        objective: AttackObjective,
        rng: np.random.Generator,
    ) -> tuple[Indices, str]:
        """At most `budget` points that the density check would not miss, and a note for the user."""
        sensor = SensorGeometry.learnt([scene])
        if sensor is None:
            return np.zeros(0, np.int64), NO_RINGS
        limit = MissingReturnLimit(scene, sensor)
        problem = StealthyDetachProblem(xyzi(scene), owner, objective, rng, limit=limit)
        return np.concatenate(greedy_allocation(problem, budget, self.query_budget))[:budget], ""

    def _greedily(
        self,
        scene: Cloud,
        allowed: Indices,
        budget: int,
        targets: AttackTargets,
        detector: ObjectDetector,
        rng: np.random.Generator,
    ) -> tuple[Indices, str]:
        """The most salient points, ranked again after each round, and a note for the user."""
        kept, removed = np.arange(len(scene)), np.zeros(0, np.int64)
        goals = np.round(np.linspace(0, budget, self.rounds + 1)).astype(int)
        for goal in goals[1:]:
            count = int(goal) - len(removed)
            if count == 0:  # fewer points to remove than rounds
                continue
            free = np.flatnonzero(np.isin(kept, allowed, assume_unique=True))
            try:
                chosen = kept[choose_salient_points(xyzi(scene[kept]), targets, detector, count, rng, free)]
            except NoGradientError:
                if not len(removed):
                    raise
                rest = _drawn(kept[free], budget - len(removed), rng)
                return np.concatenate([removed, rest]), "gradient used up: the rest removed at random"
            removed = np.concatenate([removed, chosen])
            kept = np.setdiff1d(kept, chosen, assume_unique=True)
        return removed, ""


def _drawn(points: Indices, count: int, rng: np.random.Generator) -> Indices:
    """`count` of these points, ascending, drawn like the baseline that every recipe is compared with."""
    return np.sort(random_points(points, count, rng))
