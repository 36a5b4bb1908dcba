"""Perturbation: move points by at most eps, none lost and none added."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import Detector, VoxelDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import MOVED, PointLabels
from advpipe.pipeline.labels.quantities import MAX_DISPLACEMENT, POINTS_ADDED, POINTS_REMOVED, POINTS_TOUCHED
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi
from advpipe.stages.attack.lidar.base import (
    NO_GRADIENT,
    Budget,
    LidarAttack,
    LidarResult,
    LidarTraits,
    PublishedFigure,
    told,
    unchanged,
)
from advpipe.stages.attack.lidar.constraints import GOALS, Constraints, Rules
from advpipe.stages.attack.lidar.crossing import Crossing, Tactics
from advpipe.stages.attack.lidar.goal import Goal, goal_of, owners, with_decoys
from advpipe.stages.attack.lidar.keeper import Keeper
from advpipe.stages.attack.lidar.pgd import Descent, descend, displaced
from advpipe.stages.attack.lidar.selection import NoGradientError
from advpipe.stages.attack.lidar.targets import detection_loss

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]

MAX_EPS_CM = 500.0

RECIPES = {"best": 24, "robust": 24, "paper": 40, "random": 1, "random-near": 1, "random-best": 24}
"""How many steps each takes where none are given: gradients, or random tries."""

KEEPING = ("best", "robust", "random-best")
"""Those that look at what the detector finds, and keep the best."""

TACTICS = {
    "best": Tactics(),
    # A centimetre of jitter or rounding must not carry points back.
    "robust": Tactics(landing_m=0.02, jitter_m=0.01),
}


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
            "steps": (*KEEPING, "paper"),
            "goal": KEEPING,
            "weight": ("paper",),
            "intensity": tuple(recipe for recipe in RECIPES if recipe != "paper"),
        },
    )

    def __init__(
        self,
        *,
        eps_cm: float,
        recipe: str = "best",
        steps: int = 0,
        weight: float = 0.01,
        along_ray: bool = False,
        keep_occlusion_order: bool = False,
        near_objects_m: float | None = None,
        goal: str = GOALS[0],
        objects: tuple[str, ...] = (),
        ghost: str | None = None,
        max_points: int | None = None,
        intensity: bool = False,
    ) -> None:
        if not (0 < eps_cm <= MAX_EPS_CM or (eps_cm == 0 and intensity)):
            raise UsageError(f"perturb: eps_cm is {eps_cm}, but must lie above 0 and up to {MAX_EPS_CM:g}")
        if recipe not in RECIPES:
            raise UsageError(f"perturb: unknown recipe {recipe!r}; known: {', '.join(RECIPES)}")
        if not (steps >= 0 and float(steps).is_integer()):
            raise UsageError(f"perturb: steps is {steps}, but must be a whole number from 0 up")
        if not (math.isfinite(weight) and weight >= 0):
            raise UsageError(f"perturb: weight is {weight}, but must be a number from 0 up")
        self.eps_m, self.recipe, self.weight = float(eps_cm) / 100, recipe, float(weight)
        self.steps = int(steps) or RECIPES[recipe]
        self.tactics = TACTICS.get(recipe, TACTICS["best"])
        options = {
            "along_ray": along_ray,
            "keep_occlusion_order": keep_occlusion_order,
            "near_objects_m": near_objects_m,
            "goal": goal,
            "objects": objects,
            "ghost": ghost,
            "max_points": max_points,
            "intensity": intensity,
        }
        self.constraints = Constraints.of(options)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        most = self.constraints.max_points
        return {
            MAX_DISPLACEMENT.name: (0.0, self.eps_m),
            POINTS_REMOVED.name: (0, 0),
            POINTS_ADDED.name: (0, 0),
            **({POINTS_TOUCHED.name: (0, most)} if most is not None else {}),
        }

    @property
    def looks(self) -> int:
        """How many tries the detector judges, for the best to be kept."""
        return self.steps if self.recipe in KEEPING else 1

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: Detector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud with points moved; unchanged, with a note, where there is nothing to attack."""
        finite = np.flatnonzero(np.isfinite(xyzi(cloud)).all(axis=1))
        if not len(finite):
            return unchanged(cloud, "no points to move")
        scene = cloud[finite]
        goal = goal_of(self.constraints, detector, scene, boxes)
        loss_before = detection_loss(detector, scene, goal.taught)
        if not len(goal) and self.recipe != "random":
            return unchanged(cloud, goal.note)
        if self.tactics.decoys and self.recipe in KEEPING:
            goal = with_decoys(goal, detector, scene, boxes)
        rules = self.constraints.on(xyz(scene), boxes)
        try:
            points, note = self._moved(xyzi(scene), goal, detector, rules, rng)
        except NoGradientError:
            return unchanged(cloud, told(goal.note, NO_GRADIENT), loss_before)
        adversarial = cloud.copy()
        for column, name in enumerate(("x", "y", "z", "intensity")):
            adversarial[name][finite] = points[:, column]
        labels = _labels(cloud, adversarial, finite)
        loss_after = detection_loss(detector, adversarial[finite], goal.taught)
        still = "" if len(labels) else "nothing moved: no point that may move does harm in its reach"
        note = told(goal.note if len(goal) else "", note, still)
        return LidarResult(adversarial, labels, loss_before, loss_after, note)

    def _moved(
        self, points: Float32, goal: Goal, detector: Detector, rules: Rules, rng: np.random.Generator
    ) -> tuple[Float32, str]:
        """The points (N, 4) after the attack, by its recipe, and what the user must know."""
        note, owner = "", owners(points[:, :3], goal.regions, self.tactics.margin_m)
        if self.recipe == "paper":
            moved = descend(points, goal, detector, rules, Descent(self.eps_m, self.steps, self.weight), rng)
        elif self.recipe == "random":
            moved = _shaken(points, rules, self.eps_m, rng)
        elif self.recipe == "random-near":
            moved = _shaken(points, rules, self.eps_m, rng, owner >= 0)
        elif self.recipe == "random-best":
            keeper = Keeper(goal, detector, points, owner)
            for _ in range(self.steps):
                keeper.show(_shaken(points, rules, self.eps_m, rng, owner >= 0))
            moved = keeper.settle()
        elif isinstance(detector, VoxelDetector):
            moved = Crossing(points, goal, detector, rules, self.eps_m, self.tactics, rng).run(self.steps)
        else:
            note = (
                f"recipe {self.recipe} needs a detector with occupancy_loss; used PGD with the best iterate"
            )
            note = told(note, "which leaves intensities alone" if rules.constraints.intensity else "")
            keeper = Keeper(goal, detector, points, owner)
            moved = descend(points, goal, detector, rules, Descent(self.eps_m, self.steps), rng, keeper)
        return moved, note


def _shaken(
    points: Float32, rules: Rules, reach_m: float, rng: np.random.Generator, near: Bool | None = None
) -> Float32:
    """Points (N, 4) moved by the whole reach in random directions, as far as the constraints let them.

    Only those `near` (N,), if given. Where intensities are attacked, theirs are drawn anew.
    """
    directions = rng.standard_normal((len(points), 3))
    directions *= reach_m / np.linalg.norm(directions, axis=1, keepdims=True)
    chosen = rules.limit(
        np.where(rules.allowed if near is None else rules.allowed & near, rng.random(len(points)), 0)
    )
    moved = displaced(points, rules.project(np.where(chosen[:, None], directions, 0.0)), reach_m)
    if rules.constraints.intensity:
        drawn = rng.uniform(points[:, 3].min(), points[:, 3].max(), len(points)).astype(np.float32)
        moved[:, 3] = np.where(chosen, drawn, points[:, 3])
    return moved


def _labels(cloud: Cloud, adversarial: Cloud, finite: npt.NDArray[np.int64]) -> PointLabels:
    """Labels of the points that the attack changed."""
    before, after = xyzi(cloud[finite]).astype(np.float64), xyzi(adversarial[finite]).astype(np.float64)
    changed = np.flatnonzero((before != after).any(axis=1))
    displacement_m = np.linalg.norm(after[changed, :3] - before[changed, :3], axis=1)
    return PointLabels(finite[changed], np.full(len(changed), MOVED), displacement_m)
