"""Attachment: hide objects, or create ghost objects, by a few added points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.addition_problem import add_greedily
from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.black_box import as_seen_by, told_by
from advpipe.pipeline.adversary.constraints import BLACK_BOX, GOALS, TRUTHS, Constraints, Rules
from advpipe.pipeline.adversary.copied_intensities import copied_intensities
from advpipe.pipeline.adversary.expectation import EXPECTATIONS
from advpipe.pipeline.adversary.expected_objective import ExpectedObjective
from advpipe.pipeline.adversary.goal import goal_of, known_boxes
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.adversary.greedy_allocation import queries
from advpipe.pipeline.adversary.notes import join_notes
from advpipe.pipeline.adversary.places import (
    Places,
    ball_places,
    joined,
    no_places,
    with_drawn_intensities,
)
from advpipe.pipeline.adversary.random_best import (
    MARGIN_M,
    PLACES_PER_POINT,
    REST_M,
    RandomBest,
    addition_sources,
)
from advpipe.pipeline.adversary.subset_search import SubsetSearch
from advpipe.pipeline.adversary.surrogate import proposing
from advpipe.pipeline.adversary.targets import look
from advpipe.pipeline.attack_detection.coordinate_grid import on_grid_of
from advpipe.pipeline.attack_detection.scan_order import as_measured, scan_order_of
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.nearest_points import nearest_points
from advpipe.pipeline.labels.points import ADDED, PointLabels
from advpipe.pipeline.labels.quantities import ADDED_DISTANCE, POINTS_ADDED, POINTS_MOVED, POINTS_REMOVED
from advpipe.pipeline.messages.cloud import Cloud, chosen_points, is_finite, joined_clouds, xyz, xyzi
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.lidar.attach_intensities import attach_intensities
from advpipe.stages.attack.lidar.attach_paper import salient_copies
from advpipe.stages.attack.lidar.attach_places import voxel_places
from advpipe.stages.attack.lidar.attach_problem import AttachProblem
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
from advpipe.stages.attack.lidar.loss_problems import LossAdditionProblem
from advpipe.stages.attack.lidar.robust_attach import RobustAttachProblem
from advpipe.stages.attack.lidar.stealthy import (
    NO_RINGS,
    StealthyAttachProblem,
    empty_ray_places,
    rays_of,
)

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

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

MAX_EPS_M = 5.0

MAX_POINTS = 100_000
"""About the points of a whole LiDAR cloud; more would not fit into memory."""

INSET_M = {"best": 0.002, "hide": 0.002, "robust": 0.05, "transfer": 0.05}
"""The distance of added points from the faces of their voxel, at most 0.45 of its size: a sub-voxel shift
seldom moves one by 5 cm."""


@dataclass(kw_only=True, eq=False)
class Attach(LidarAttack):
    """Add exactly `points` points to a cloud, each within `eps_m` of one of its own, in float64 as stored.

    The attacker knows the detector, the true boxes (or its detections, `truth`) and the rule that matches
    detections to them (`goal`).

    points: how many points to add.
    eps_m: how far from the clean cloud's points they may lie.
    recipe: "best" fills the empty voxels whose occupancy affects the detector most, at the place nearest to a
        clean point, evaluates the detections, and spends the points on the objects that need the fewest; for
        a detector without `occupancy_loss`, it searches random places and those that the shipped detector
        needs by the detections (`subset_search`). "hide" is "best" with the goal to hide: no box that
        overlaps an object loosely is left. "robust" keeps a distance from the voxels' faces, and takes gains
        and objective as means over draws of defences (`expectation`), a pass for each of four; "transfer"
        likewise over other views of the scene, to hold on other detectors. "stealthy" adds at most so many
        points, one on each of the rays that returned nothing, before what would hide them. "score-based" and
        "decision-based" are black-box attacks: they see detections alone, the second no scores (`black_box`),
        and search random places (`subset_search`) at the objects that are detected in the clean cloud.
        "paper" shifts copies of the most salient points (`attach_paper`). Random baselines: "random" in balls
        around any points, "random-near" around those near objects, "random-best" likewise with the selection
        of "best": what reports compare the attack with. New points have the intensity of the point that they
        start from, or nearly, where a sensor never states the same twice.
    rounds: how often "best", "hide" and "stealthy" rank the places.
    queries: how many detections the black-box recipes ask for.
    weight: lambda of the paper's dual loss (loss units per square metre); the paper gives no value.
    decay_m: recipes that follow gains multiply that of a point at distance d from the clean ones by
        exp(-(d / decay_m)**2), or draw so many fewer there: a small decay_m gives a small Chamfer distance.
    along_ray, keep_occlusion_order, near_objects_m, goal, truth, objects, ghost, intensity: see
        `constraints.Constraints`.
    """

    traits = LidarTraits(
        budget=Budget(
            title="Attachment, ε in m",
            parameter="eps_m",
            unit="m",
            default=0.5,
            steps="rounds",
            shared_parameters={"points": 300},
            published=(
                PublishedFigure(table_value=0.05, map_ratio_percent=98.82, chamfer_distance_m2=0.00005),
                PublishedFigure(table_value=0.1, map_ratio_percent=95.19, chamfer_distance_m2=0.00011),
                PublishedFigure(table_value=0.3, map_ratio_percent=87.72, chamfer_distance_m2=0.00054),
                PublishedFigure(table_value=0.5, map_ratio_percent=78.46, chamfer_distance_m2=0.00126),
                PublishedFigure(table_value=0.7, map_ratio_percent=77.24, chamfer_distance_m2=0.00226),
                PublishedFigure(table_value=1.0, map_ratio_percent=77.09, chamfer_distance_m2=0.00429),
            ),
        ),
        only_for={
            "rounds": STEPPING,
            "queries": BLACK_BOX,
            "goal": WITH_GOAL,
            "weight": ("paper",),
            "decay_m": ("best", "hide", "stealthy", *EXPECTATIONS),
            "intensity": tuple(recipe for recipe in QUERYING if recipe != "stealthy"),
        },
    )

    eps_m: float
    points: int = 300
    recipe: str = "best"
    rounds: int = 10
    queries: int = QUERIES
    weight: float = 0.0
    decay_m: float = 1.0
    along_ray: bool = False
    keep_occlusion_order: bool = False
    near_objects_m: float | None = None
    goal: str = GOALS[0]
    truth: str = TRUTHS[0]
    objects: tuple[str, ...] = ()
    ghost: str | None = None
    intensity: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.eps_m <= MAX_EPS_M:
            raise UsageError(f"attach: eps_m is {self.eps_m}, but must lie above 0 and up to {MAX_EPS_M:g}")
        if not self.decay_m > 0:
            raise UsageError(f"attach: decay_m is {self.decay_m}, but must be above 0")
        checked_choice("attach", "recipe", self.recipe, RECIPES)
        checked_number("attach", "weight", self.weight, 0)
        self.points = checked_integer("attach", "points", self.points, 1, MAX_POINTS)
        self.rounds = checked_integer("attach", "rounds", self.rounds, 1, MAX_ROUNDS)
        self.queries = checked_integer("attach", "queries", self.queries, 2, MAX_ROUNDS)
        self.constraints = Constraints.among(vars(self))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {
            ADDED_DISTANCE.name: (0.0, self.eps_m),
            POINTS_ADDED.name: (0 if self.recipe == "stealthy" else self.points, self.points),
            POINTS_MOVED.name: (0, 0),
            POINTS_REMOVED.name: (0, 0),
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
        return self.queries if self.recipe in BLACK_BOX else queries(self.rounds)

    @property
    def needs_ground_truth(self) -> bool:
        return self.constraints.need_ground_truth(is_random=self.recipe == "random")

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud with the new points at its end, each with the ring and the time of its direction;
        unchanged, with a note, if there is nothing to attack."""
        finite = is_finite(cloud)
        scene = cloud if finite.all() else chosen_points(cloud, finite)
        if not len(scene):
            return unchanged(cloud, "no points to start from")
        clean, seen = xyzi(scene), as_seen_by(self.recipe, detector)
        boxes = known_boxes(self.constraints, seen, scene, boxes)
        goal = goal_of(self.constraints, seen, scene, boxes)
        loss_before, found = look(detector, clean, goal.reported_targets)
        focused = self.recipe != "random" or self.constraints.objects or self.constraints.ghost
        if not len(goal.targets) and focused:
            return unchanged(cloud, goal.note)
        rules = Rules(self.constraints, clean[:, :3], boxes)
        objective = AttackObjective(goal, seen, goal.success(told_by(seen, found)))
        try:
            if self.recipe == "stealthy":
                places, note = self._on_empty_rays(scene, objective, rules, rng)
            else:
                places, note = self._places(clean, objective, rules, rng)
        except NoGradientError:
            return unchanged(cloud, join_notes(goal.note, NO_GRADIENT), loss_before)
        if len(places) < (1 if self.recipe == "stealthy" else self.points):
            note = note or "the constraints leave no place for so many points"
            return unchanged(cloud, note, loss_before)
        added = chosen_points(scene, places.source)
        points = places.points
        if not (self.constraints.along_ray or self.recipe == "stealthy"):  # no place of a grid lies on a ray
            points = on_grid_of(scene, clean[places.source], points)
        for column, name in enumerate(("x", "y", "z", "intensity")):
            added[name] = points[:, column]
        if not self.constraints.intensity:
            added["intensity"] = copied_intensities(scene["intensity"], places.source)
        added = as_measured(scene, added, scan_order_of(scene))
        adversarial = joined_clouds(cloud, added)
        loss_after, _ = look(detector, np.concatenate([clean, xyzi(added)]), goal.reported_targets)
        note = join_notes(goal.note if len(goal.targets) else "", note)
        return LidarResult(adversarial, _labels(clean, added), loss_before, loss_after, note)

    def _places(
        self,
        clean: Float32,
        objective: AttackObjective,
        rules: Rules,
        rng: np.random.Generator,
    ) -> tuple[Places, str]:
        """The places of the new points, and a note for the user."""
        goal, detector, count = objective.goal, objective.detector, self.points
        boxes = goal.targets.boxes.double().numpy()
        if self.recipe == "random":
            everywhere = np.flatnonzero(rules.allowed)
            return self._random_places(clean, everywhere, count, boxes, rules, rng), ""
        if self.recipe == "paper":
            return salient_copies(clean, goal, detector, rules, count, self.eps_m, self.weight, rng), ""
        if self.recipe in ("random-near", "random-best"):
            random = RandomBest(clean, goal, detector, rules, self.query_budget, rng)
            return random.added(self.points, self.eps_m), ""
        sources = addition_sources(clean, boxes, rules)
        if isinstance(detector, VoxelDetector):
            grid, inset_m, note = detector.voxel_grid, INSET_M[self.recipe], ""
            inset_m = min(inset_m, 0.45 * min(grid.size_m))
            places = voxel_places(clean, boxes, grid, rules, self.eps_m, MARGIN_M, inset_m)
            problem = AttachProblem(clean, places, objective, rng, decay_m=self.decay_m)
            if self.recipe in EXPECTATIONS:
                expected = ExpectedObjective.over(objective, clean, EXPECTATIONS[self.recipe](clean), rng)
                problem = RobustAttachProblem(clean, places, expected, rng, decay_m=self.decay_m)
            best = add_greedily(problem, self.points, self.query_budget)
        else:
            note = "" if self.recipe in BLACK_BOX else search_note(detector)
            places = self._random_places(clean, sources, PLACES_PER_POINT * self.points, boxes, rules, rng)
            if (surrogate := proposing(detector)) is not None:
                grid, inset_m = surrogate.voxel_grid, INSET_M["best"]
                aimed = voxel_places(clean, boxes, grid, rules, self.eps_m, MARGIN_M, inset_m)
                places = joined([places, aimed])
            best = self._searched_places(clean, places, objective, rng)
        if short := self.points - len(best):
            note = join_notes(note, "nothing more to gain: the rest added at random")
            near_m = min(self.eps_m, REST_M)
            rest = ball_places(clean, sources, short, boxes, rules, near_m, MARGIN_M, rng)
            best = joined([best, rest])
        if self.constraints.intensity and isinstance(detector, VoxelDetector):
            best = attach_intensities(clean, best, goal, objective, detector)
        return best, note

    def _searched_places(
        self,
        clean: Float32,
        places: Places,
        objective: AttackObjective,
        rng: np.random.Generator,
    ) -> Places:
        """Those of random places that a search by scores finds; far ones are fewer, as `decay_m` says."""
        places = places[rng.random(len(places)) < np.exp(-((places.distance_m / self.decay_m) ** 2))]
        if self.constraints.intensity:
            places = with_drawn_intensities(places, clean, rng)
        problem = LossAdditionProblem(clean, places, objective, rng)
        return places[SubsetSearch(problem, rng).allocation(self.points, self.query_budget)]

    def _on_empty_rays(
        self, scene: Cloud, objective: AttackObjective, rules: Rules, rng: np.random.Generator
    ) -> tuple[Places, str]:
        """At most as many places as there are points, one on each ray that returned nothing."""
        sensor = SensorGeometry.learnt([scene])
        if sensor is None:
            return no_places(), NO_RINGS
        boxes = objective.goal.targets.boxes.double().numpy()
        places = empty_ray_places(scene, boxes, sensor, rules, self.eps_m, MARGIN_M, rng)
        rays = rays_of(places, sensor)
        problem = StealthyAttachProblem(xyzi(scene), places, objective, rng, decay_m=self.decay_m, rays=rays)
        return add_greedily(problem, self.points, self.query_budget), ""

    def _random_places(
        self,
        clean: Float32,
        sources: Int64,
        count: int,
        boxes: Float64,
        rules: Rules,
        rng: np.random.Generator,
    ) -> Places:
        return ball_places(clean, sources, count, boxes, rules, self.eps_m, MARGIN_M, rng)


def _labels(clean: Float32, added: Cloud) -> PointLabels:
    """The labels of added points: their distance from the nearest of the clean points (N, 4)."""
    distance_m, _ = nearest_points(clean[:, :3], xyz(added))
    return PointLabels(np.full(len(added), -1, np.int64), np.full(len(added), ADDED), distance_m)
