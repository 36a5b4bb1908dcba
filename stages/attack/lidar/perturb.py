"""Perturbation: move points by at most eps, none lost and none added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import MOVED, PointLabels
from advpipe.pipeline.labels.quantities import MAX_DISPLACEMENT, POINTS_ADDED, POINTS_REMOVED
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi
from advpipe.stages.attack.bounds import checked_number, one_of, whole
from advpipe.stages.attack.lidar.base import (
    MAX_ROUNDS,
    NO_GRADIENT,
    QUERYING,
    Budget,
    LidarAttack,
    LidarResult,
    LidarTraits,
    PublishedFigure,
    join_notes,
    unchanged,
)
from advpipe.stages.attack.lidar.chance import Chance
from advpipe.stages.attack.lidar.constraints import GOALS, Constraints, Rules
from advpipe.stages.attack.lidar.crossing import Crossing, Tactics
from advpipe.stages.attack.lidar.goal import goal_of, owners, with_decoys
from advpipe.stages.attack.lidar.per_object_best import PerObjectBest
from advpipe.stages.attack.lidar.pgd import Descent
from advpipe.stages.attack.lidar.search import Search
from advpipe.stages.attack.lidar.selection import NoGradientError
from advpipe.stages.attack.lidar.targets import detection_loss

MAX_EPS_CM = 500.0

NO_OCCUPANCY = "recipe {} needs a detector with occupancy_loss; used PGD with the best iterate"
INTENSITY_STAYS = "which leaves intensities alone"
NOTHING_MOVED = "nothing moved: no point that may move does harm in its reach"

RECIPES = {"best": 24, "robust": 24, "paper": 40, "random": 1, "random-near": 1, "random-best": 24}
"""How many steps each takes where none are given: gradients, or random tries."""

BY_CHANCE = ("random", "random-near", "random-best")

TACTICS = {
    "best": Tactics(),
    # A centimetre of jitter or rounding must not carry points back.
    "robust": Tactics(landing_m=0.02, jitter_m=0.01),
}


@dataclass(kw_only=True, eq=False)
class Perturb(LidarAttack):
    """Move points by at most `eps_cm` centimetres each, in the Euclidean norm, as stored in float32.

    The attacker knows the detector, the true boxes and the rule that matches detections to them (`goal`).

    recipe: "best" crosses the voxel faces that the detector's answer hangs on and keeps for each object what
        hurt it most (`crossing`); for a detector without occupancies it is PGD near objects that keeps
        the best. "robust" lands 2 cm past the faces (eps / 2 at most) and counts on 1 cm of jitter; it is
        far weaker without jitter, and under it not surely stronger than "random-best". "paper" is the PGD of
        the paper (section III-A, Eq. 1 and 2) on all points. By chance: "random" moves all points by eps in
        a random direction, "random-near" those near objects, and "random-best" tries `steps` times there,
        with the selection of "best": the strongest baseline, which reports do not score by themselves.
    eps_cm: how far each point may move.
    steps: gradients or tries; 0 for the recipe's own number (the paper: 40).
    weight: lambda of the paper's dual loss, in loss units a square metre; only for "paper". At 0.01 it holds
        points to 2 mm (RMS, of 10 cm allowed), as steps are of equal length for each point; at 0 they go to
        8.7 cm, and the Chamfer distance is the paper's.
    along_ray, keep_occlusion_order, near_objects_m, goal, objects, ghost, max_points, intensity: see
        `constraints.Constraints`. Points that are not finite stay as they are.
    """

    traits = LidarTraits(
        budget=Budget(
            title="Perturbation, ε in cm",
            parameter="eps_cm",
            unit="cm",
            usual=10.0,
            steps="steps",
            published=(
                PublishedFigure(printed=0.5, map_ratio_percent=99.85, chamfer_distance_m2=0.00010),
                PublishedFigure(printed=1.0, map_ratio_percent=98.77, chamfer_distance_m2=0.00025),
                PublishedFigure(printed=3.0, map_ratio_percent=93.28, chamfer_distance_m2=0.00182),
                PublishedFigure(printed=5.0, map_ratio_percent=89.07, chamfer_distance_m2=0.00466),
                PublishedFigure(printed=7.0, map_ratio_percent=82.79, chamfer_distance_m2=0.00842),
                PublishedFigure(printed=10.0, map_ratio_percent=73.20, chamfer_distance_m2=0.01533),
            ),
        ),
        only_for={
            "steps": (*QUERYING, "paper"),
            "goal": QUERYING,
            "weight": ("paper",),
            "intensity": tuple(recipe for recipe in RECIPES if recipe != "paper"),
        },
    )

    eps_cm: float
    recipe: str = "best"
    steps: int = 0
    weight: float = 0.01
    along_ray: bool = False
    keep_occlusion_order: bool = False
    near_objects_m: float | None = None
    goal: str = GOALS[0]
    objects: tuple[str, ...] = ()
    ghost: str | None = None
    max_points: int | None = None
    intensity: bool = False

    def __post_init__(self) -> None:
        if not (0 < self.eps_cm <= MAX_EPS_CM or (self.eps_cm == 0 and self.intensity)):
            raise UsageError(
                f"perturb: eps_cm is {self.eps_cm}, but must lie above 0 and up to {MAX_EPS_CM:g}"
            )
        one_of("perturb", "recipe", self.recipe, RECIPES)
        checked_number("perturb", "weight", self.weight, 0)
        self.eps_m = float(self.eps_cm) / 100
        self.steps = whole("perturb", "steps", self.steps, 0, MAX_ROUNDS) or RECIPES[self.recipe]
        self.tactics = TACTICS.get(self.recipe, TACTICS["best"])
        self.constraints = Constraints.among(vars(self))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {
            MAX_DISPLACEMENT.name: (0.0, self.eps_m),
            POINTS_REMOVED.name: (0, 0),
            POINTS_ADDED.name: (0, 0),
            **self.constraints.bounds,
        }

    @property
    def query_budget(self) -> int:
        return self.steps if self.recipe in QUERYING else 1

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud with points moved; unchanged, with a note, where there is nothing to attack."""
        # Prepare: the points that exist, whom to fight, and what may be touched.
        finite = np.flatnonzero(np.isfinite(xyzi(cloud)).all(axis=1))
        if not len(finite):
            return unchanged(cloud, "no points to move")
        scene = cloud[finite]
        points = xyzi(scene)
        goal = goal_of(self.constraints, detector, scene, boxes)
        loss_before = detection_loss(detector, scene, goal.loss_targets)
        if not len(goal.targets) and self.recipe != "random":
            return unchanged(cloud, goal.note)
        is_querying = self.recipe in QUERYING
        if is_querying and self.tactics.decoys:
            goal = with_decoys(goal, detector, scene, boxes)
        rules = Rules(self.constraints, xyz(scene), boxes)
        owner = owners(points[:, :3], goal.regions, self.tactics.margin_m)
        everywhere, near, note, jitter_m = np.ones(len(points), bool), owner >= 0, "", 0.0

        # Start: how points are moved from where they are.
        search: Search
        if self.recipe in BY_CHANCE:
            search = Chance(points, rules, everywhere if self.recipe == "random" else near, self.eps_m, rng)
        elif self.recipe == "paper":
            search = Descent(points, goal, detector, rules, everywhere, self.eps_m, rng, self.weight)
        elif isinstance(detector, VoxelDetector):
            search = Crossing(points, goal, detector, rules, owner, self.eps_m, self.tactics, rng)
            jitter_m = self.tactics.jitter_m
        else:
            search = Descent(points, goal, detector, rules, near, self.eps_m, rng)
            note = join_notes(NO_OCCUPANCY.format(self.recipe), INTENSITY_STAYS if self.intensity else "")
        judge = (
            PerObjectBest(goal, detector, points, owner, jitter_m, rng)
            if is_querying and self.tactics.keep
            else None
        )

        # Descend, have the detector judge each attempt, and choose what hurt it most.
        moved = points
        try:
            for moved in search.attempts(self.steps):
                search.keep(everywhere if judge is None else judge.show(moved))
        except NoGradientError:
            return unchanged(cloud, join_notes(goal.note, NO_GRADIENT), loss_before)
        if judge is not None:
            moved = judge.settle()

        # Write back what changed, and label it.
        adversarial = cloud.copy()
        for column, name in enumerate(("x", "y", "z", "intensity")):
            adversarial[name][finite] = moved[:, column]
        loss_after = detection_loss(detector, adversarial[finite], goal.loss_targets)
        changed = np.flatnonzero((points != moved).any(axis=1))
        way_m = moved[changed, :3].astype(np.float64) - points[changed, :3]
        displacement_m = np.linalg.norm(way_m, axis=1)
        labels = PointLabels(finite[changed], np.full(len(changed), MOVED), displacement_m)
        note = join_notes(goal.note if len(goal.targets) else "", note, "" if len(changed) else NOTHING_MOVED)
        return LidarResult(adversarial, labels, loss_before, loss_after, note)
