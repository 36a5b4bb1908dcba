"""Perturbation: move points by at most eps, without removing or adding any."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.black_box import as_seen_by, told_by
from advpipe.pipeline.adversary.constraints import BLACK_BOX, GOALS, TRUTHS, Constraints, Rules
from advpipe.pipeline.adversary.expectation import EXPECTATIONS
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal, goal_of, known_boxes, owners, with_decoys
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.adversary.per_object_best import PerObjectBest
from advpipe.pipeline.adversary.random_best import RandomBest
from advpipe.pipeline.adversary.random_search import RandomSearch
from advpipe.pipeline.adversary.surrogate import proposing
from advpipe.pipeline.adversary.targets import look
from advpipe.pipeline.attack_detection.coordinate_grid import on_grid_of
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.lengths import lengths
from advpipe.pipeline.labels.points import MOVED, PointLabels
from advpipe.pipeline.labels.quantities import MAX_DISPLACEMENT, MAX_OFF_RAY, POINTS_ADDED, POINTS_REMOVED
from advpipe.pipeline.messages.cloud import Cloud, chosen_points, copy_of, is_finite, xyzi
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
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
from advpipe.stages.attack.lidar.crossing_search import CrossingSearch, CrossingSettings
from advpipe.stages.attack.lidar.mixed_search import MixedSearch
from advpipe.stages.attack.lidar.pgd import ProjectedGradientDescent
from advpipe.stages.attack.lidar.robust_search import RobustSearch
from advpipe.stages.attack.lidar.score_search import ScoreSearch
from advpipe.stages.attack.lidar.search import Search

Float32 = npt.NDArray[np.float32]

MAX_EPS_CM = 500.0

ON_RAY_URAD = 0.4
"""A point that is moved along its ray leaves it by less, in microradians: float32 rounds coordinates."""

NOTHING_MOVED = "nothing moved: no point that may move does harm in its reach"

RECIPES = {
    "best": 24,
    "hide": 48,
    "robust": 24,
    "stealthy": 24,
    "transfer": 24,
    "paper": 40,
    "random": 1,
    "random-near": 1,
    "random-best": 24,
    "score-based": 24,
    "decision-based": 24,
}
"""The default number of steps of each recipe: gradients, or random candidates."""

SETTINGS = {"best": CrossingSettings(), "stealthy": CrossingSettings(spread=True)}


@dataclass(kw_only=True, eq=False)
class Perturb(LidarAttack):
    """Move points by at most `eps_cm` centimetres each, in the Euclidean norm, as stored in float32.

    The attacker knows the detector, the true boxes (or its detections, `truth`) and the rule that matches
    detections to them (`goal`).

    eps_cm: how far each point may move.
    recipe: "best" moves points across the voxel faces that matter to the detector and keeps the best
        candidate for each object (`crossing_search`); for a detector without `occupancy_loss` it searches by
        the detections, crossings of the shipped detector's voxels and deformations (`mixed_search`). "hide"
        is "best" with the goal to hide, no box that overlaps an object loosely is left, and twice the steps.
        "robust" moves points by the whole reach, and takes gains and successes as means over draws of
        defences (`robust_search`), a pass for each of four. "transfer" does so over other views of the scene
        (`input_diversity`), to hold on other detectors. "stealthy" keeps points on their rays and before what
        hides them, and spreads them in the voxels, so that the checks of `evaluate` do not notice.
        "score-based" and "decision-based" are black-box attacks: they see detections alone, the second no
        scores (`black_box`), and search deformations (`score_search`) of the objects that are detected in the
        clean cloud. "paper" is the PGD of the paper (section III-A, Eq. 1 and 2) on all points. Random
        baselines: "random" moves all points by eps in a random direction, "random-near" those near objects,
        and "random-best" draws `steps` candidates there, with the selection of "best": the baseline that
        reports compare the attack with.
    steps: gradients or random candidates; 0 for the recipe's default (the paper: 40).
    queries: how many detections the black-box recipes ask for.
    weight: lambda of the paper's dual loss, in loss units per square metre; only for "paper", which names a
        lambda and gives no value. At 0 points move by 8.7 cm (RMS, of 10 cm allowed), with the Chamfer
        distance of the paper; at 0.01 by millimetres or a few centimetres, depending on the drive, as steps
        have equal length for each point.
    along_ray, keep_occlusion_order, near_objects_m, goal, truth, objects, ghost, max_points, intensity: see
        `constraints.Constraints`. Points that are not finite stay as they are.
    """

    traits = LidarTraits(
        budget=Budget(
            title="Perturbation, ε in cm",
            parameter="eps_cm",
            unit="cm",
            default=10.0,
            steps="steps",
            published=(
                PublishedFigure(table_value=0.5, map_ratio_percent=99.85, chamfer_distance_m2=0.00010),
                PublishedFigure(table_value=1.0, map_ratio_percent=98.77, chamfer_distance_m2=0.00025),
                PublishedFigure(table_value=3.0, map_ratio_percent=93.28, chamfer_distance_m2=0.00182),
                PublishedFigure(table_value=5.0, map_ratio_percent=89.07, chamfer_distance_m2=0.00466),
                PublishedFigure(table_value=7.0, map_ratio_percent=82.79, chamfer_distance_m2=0.00842),
                PublishedFigure(table_value=10.0, map_ratio_percent=73.20, chamfer_distance_m2=0.01533),
            ),
        ),
        only_for={
            "steps": (*STEPPING, "paper"),
            "queries": BLACK_BOX,
            "goal": WITH_GOAL,
            "weight": ("paper",),
            "intensity": tuple(recipe for recipe in RECIPES if recipe not in ("paper", *EXPECTATIONS)),
        },
    )

    eps_cm: float
    recipe: str = "best"
    steps: int = 0
    queries: int = QUERIES
    weight: float = 0.0
    along_ray: bool = False
    keep_occlusion_order: bool = False
    near_objects_m: float | None = None
    goal: str = GOALS[0]
    truth: str = TRUTHS[0]
    objects: tuple[str, ...] = ()
    ghost: str | None = None
    max_points: int | None = None
    intensity: bool = False

    def __post_init__(self) -> None:
        if not (0 < self.eps_cm <= MAX_EPS_CM or (self.eps_cm == 0 and self.intensity)):
            raise UsageError(
                f"perturb: eps_cm is {self.eps_cm}, but must lie above 0 and up to {MAX_EPS_CM:g}"
            )
        checked_choice("perturb", "recipe", self.recipe, RECIPES)
        checked_number("perturb", "weight", self.weight, 0)
        self.eps_m = float(self.eps_cm) / 100
        self.steps = checked_integer("perturb", "steps", self.steps, 0, MAX_ROUNDS) or RECIPES[self.recipe]
        self.queries = checked_integer("perturb", "queries", self.queries, 1, MAX_ROUNDS)
        self.settings = SETTINGS.get(self.recipe, SETTINGS["best"])
        self.constraints = Constraints.among(vars(self))
        if self.recipe == "stealthy":
            self.constraints = replace(self.constraints, along_ray=True, keep_occlusion_order=True)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {
            MAX_DISPLACEMENT.name: (0.0, self.eps_m),
            POINTS_REMOVED.name: (0, 0),
            POINTS_ADDED.name: (0, 0),
            **({MAX_OFF_RAY.name: (0.0, ON_RAY_URAD)} if self.recipe == "stealthy" else {}),
            **self.constraints.bounds,
        }

    @property
    def uses_surrogate(self) -> bool:
        return self.recipe in PROPOSING

    @property
    def query_budget(self) -> int:
        return self.baseline_tries if self.recipe in QUERYING else 1

    @property
    def baseline_tries(self) -> int:
        """As many as recipe best judges; for a black-box recipe, as many as it asks for."""
        if self.recipe in BLACK_BOX:
            return self.queries
        return self.steps if self.recipe in QUERYING else RECIPES["best"]

    @property
    def needs_ground_truth(self) -> bool:
        return self.constraints.need_ground_truth(is_random=self.recipe == "random")

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud with points moved; unchanged, with a note, if there is nothing to attack."""
        # Prepare: the finite points, the targets, and the points that may move.
        finite = np.flatnonzero(is_finite(cloud))
        if not len(finite):
            return unchanged(cloud, "no points to move")
        scene = chosen_points(cloud, finite)
        points = xyzi(scene)
        seen = as_seen_by(self.recipe, detector)
        boxes = known_boxes(self.constraints, seen, scene, boxes)
        goal = goal_of(self.constraints, seen, scene, boxes)
        loss_before, found = look(detector, points, goal.reported_targets)
        found = told_by(seen, found)
        if not len(goal.targets) and self.recipe != "random":
            return unchanged(cloud, goal.note)
        if self.recipe in QUERYING and self.settings.decoys:
            goal = with_decoys(goal, found, boxes)
        try:
            moved, note = self._moved(
                points, goal, seen, found, Rules(self.constraints, points[:, :3], boxes), rng
            )
        except NoGradientError:
            return unchanged(cloud, join_notes(goal.note, NO_GRADIENT), loss_before)

        if not self.constraints.along_ray:  # no place of a grid lies on the ray
            moved = on_grid_of(scene, points, moved)
        adversarial = copy_of(cloud)
        where = slice(None) if len(finite) == len(cloud) else finite
        for column, name in enumerate(("x", "y", "z", "intensity")):
            adversarial[name][where] = moved[:, column]
        loss_after, _ = look(detector, moved, goal.reported_targets)
        differs = points != moved
        changed = np.flatnonzero(differs[:, 0] | differs[:, 1] | differs[:, 2] | differs[:, 3])
        displacement_m = lengths(moved[changed, :3].astype(float) - points[changed, :3])
        labels = PointLabels(finite[changed], np.full(len(changed), MOVED), displacement_m)
        note = join_notes(goal.note if len(goal.targets) else "", note, "" if len(changed) else NOTHING_MOVED)
        return LidarResult(adversarial, labels, loss_before, loss_after, note)

    def _moved(
        self,
        points: Float32,
        goal: AttackGoal,
        detector: ObjectDetector,
        found: Detections,
        rules: Rules,
        rng: np.random.Generator,
    ) -> tuple[Float32, str]:
        """The points (N, 4) where they are moved to, and a note for the user. found: in the clean points."""
        everywhere = np.ones(len(points), bool)
        if self.recipe == "random":
            return next(RandomSearch(points, rules, everywhere, self.eps_m, rng).candidates(1)), ""
        if self.recipe in ("random-near", "random-best"):
            random = RandomBest(points, goal, detector, rules, self.query_budget, rng)
            return random.moved(self.eps_m), ""
        if self.recipe == "paper":
            paper = ProjectedGradientDescent(
                points, goal, detector, rules, everywhere, self.eps_m, rng, self.weight
            )
            *_, last = paper.candidates(self.steps)
            return last.points, ""
        owner, focus = (
            owners(points[:, :3], goal.regions, self.settings.margin_m),
            Focus(points, goal.regions),
        )
        if self.recipe in EXPECTATIONS and isinstance(detector, VoxelDetector):
            expectation = EXPECTATIONS[self.recipe](points)
            robust = RobustSearch(points, goal, detector, rules, owner, self.eps_m, expectation, rng)
            return robust.moved(self.steps), ""
        note = ""
        search: Search
        if isinstance(detector, VoxelDetector):
            search = CrossingSearch(
                points, goal, detector, rules, owner, focus, self.eps_m, self.settings, rng
            )
        else:
            search = scores = ScoreSearch(points, goal, detector, rules, owner, focus, self.eps_m, rng)
            note = "" if self.recipe in BLACK_BOX else search_note(detector)
            if (surrogate := proposing(detector)) is not None:
                crossings = CrossingSearch(
                    points, goal, surrogate, rules, owner, focus, self.eps_m, self.settings, rng
                )
                search = MixedSearch(crossings, scores, owner, rng)
        if not self.settings.keep_best:
            unjudged = points
            for candidate in search.candidates(self.steps):
                unjudged = candidate.points
                search.accept(everywhere)
            return unjudged, note
        most = self.constraints.max_points
        best = PerObjectBest(goal, detector, points, found, owner, focus, self.query_budget, most)
        for candidate in search.candidates(best.candidates):
            search.accept(best.update(candidate.points, candidate.found))
        return best.combined(), note
