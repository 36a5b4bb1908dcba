"""Constraints on LiDAR attacks beyond the budget: options that all of them share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from advpipe.pipeline.adversary.ghost_object import GhostObject
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.labels.quantities import POINTS_TOUCHED

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

HIDE = "hide"
"""A goal, and the recipe of that goal."""

GOALS = ("break", HIDE)

TRUTHS = ("boxes", "detections")

SCORE_BASED, DECISION_BASED = BLACK_BOX = ("score-based", "decision-based")
"""The recipes that see detections alone: neither weights nor loss, and no true boxes."""

IMPLIED = {HIDE: {"goal": HIDE}, **{recipe: {"truth": "detections"} for recipe in BLACK_BOX}}
"""The constraints that a recipe implies."""

OBJECT_MARGIN_M = 1.0
"""The reach of an attack on chosen objects around them, if `near_objects_m` is not given."""

SAME_SURFACE_M = 0.2
"""A point less than this behind its neighbours belongs to their surface and is not hidden by them."""

_NEIGHBOURS = 4
_NEIGHBOUR_RAD = math.radians(1.5)


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """The options; each default leaves an attack free.

    along_ray: points stay on their ray from the sensor, the origin of the cloud; an added point stands on
        the ray of a point of the clean cloud.
    keep_occlusion_order: no touched point comes to stand behind a surface that hides it (`Rules.hidden`).
    near_objects_m: only points within this distance of a ground-truth box, 0 for those inside.
    goal: "break" detections (misplaced boxes and false ones count too, as they do in average precision at
        strict overlap: a box of a mean car, 4.5 x 1.8 x 1.6 m, is a miss from 13 cm along all three axes at
        once, 32 cm sideways or 80 cm lengthways on), or "hide" objects: no box that overlaps them loosely is
        left. Recipes that do not query the detector have no such choice.
    truth: the objects that the attacker knows: the true "boxes", or, without labels, the "detections" in the
        clean cloud with a score of at least 0.3.
    objects: attack these boxes alone: hide them. By id; by place ("0", ...) where the truth has no ids.
    ghost: instead of hiding objects, make the detector find this ghost object.
    max_points: at most so many points of a cloud are touched.
    intensity: intensities are attacked too; otherwise they stay as measured.
    """

    along_ray: bool = False
    keep_occlusion_order: bool = False
    near_objects_m: float | None = None
    goal: str = GOALS[0]
    truth: str = TRUTHS[0]
    objects: tuple[str, ...] = field(default=())
    ghost: GhostObject | None = None
    max_points: int | None = None
    intensity: bool = False

    def __post_init__(self) -> None:
        near_m, limit = self.near_objects_m, self.max_points
        if near_m is not None and not (math.isfinite(near_m) and near_m >= 0):
            raise UsageError(f"near_objects_m is {near_m}, but must be a distance from 0 up")
        if limit is not None and not (limit >= 1 and float(limit).is_integer()):
            raise UsageError(f"max_points is {limit}, but must be a whole number from 1 up")
        if self.goal not in GOALS:
            raise UsageError(f"goal is {self.goal!r}; {known_names(self.goal, GOALS)}")
        if self.truth not in TRUTHS:
            raise UsageError(f"truth is {self.truth!r}; {known_names(self.truth, TRUTHS)}")
        if self.objects and self.truth != TRUTHS[0]:
            raise UsageError("objects are chosen by the ids of true boxes; leave out objects or truth")
        if self.ghost and (self.objects or self.goal == "hide"):
            raise UsageError("hiding objects and creating a ghost object are two attacks; give one of them")

    @staticmethod
    def of(options: Mapping[str, Any]) -> Constraints:
        """Constraints from plain values, as the command line and files give them: `ghost` and `objects` as
        text (objects also as a list). Raises AdvpipeError for an unknown name."""
        known = [option.name for option in fields(Constraints)]
        if unknown := [name for name in options if name not in known]:
            raise UsageError(f"unknown constraint {unknown[0]!r}; known: {', '.join(known)}")
        values = dict(options)
        if isinstance(values.get("ghost"), str):
            values["ghost"] = GhostObject.parse(values["ghost"])
        if "objects" in values:
            names = values["objects"]
            values["objects"] = tuple(map(str, names.split(",") if isinstance(names, str) else names))
        return Constraints(**values)

    @staticmethod
    def among(parameters: Mapping[str, Any]) -> Constraints:
        """The constraints among all parameters of an attack, its recipe with them; missing ones have their
        defaults. What a recipe implies is set."""
        known = {option.name for option in fields(Constraints)}
        found = {name: value for name, value in parameters.items() if name in known}
        return Constraints.of(found | IMPLIED.get(parameters.get("recipe", ""), {}))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """The bounds that they imply, as `LidarAttack.bounds` has them."""
        return {} if self.max_points is None else {POINTS_TOUCHED.name: (0, self.max_points)}

    def need_ground_truth(self, is_random: bool) -> bool:
        """Whether attacks under them touch only what lies at true boxes; is_random: points are chosen
        randomly, not by the objects."""
        is_near_boxes = bool(self.objects) or self.near_objects_m is not None
        takes_boxes = self.ghost is None and self.truth == TRUTHS[0]
        return takes_boxes and (is_near_boxes or not is_random)

    def attacked(self, boxes: Boxes, points: Float32) -> Boxes:
        """The targeted boxes: all, those of `objects`, or the ghost object in the cloud (N, 3).

        Empty if the objects are not in this frame, or there is no ground for the ghost object.
        """
        if self.ghost:
            return self.ghost.boxes(points)
        if not self.objects:
            return boxes
        return boxes[np.array([name in self.objects for name in _names(boxes)], bool)]

    def absent(self, boxes: Boxes) -> list[str]:
        """The chosen objects that are not among these boxes."""
        return [name for name in self.objects if name not in _names(boxes)]


@dataclass(frozen=True)
class Rules:
    """Constraints applied to one clean cloud: points (N, 3) float32, all finite, with its ground truth."""

    constraints: Constraints
    points: Float32
    boxes: Boxes

    @cached_property
    def allowed(self) -> Bool:
        """Which points (N,) may be touched."""
        return self._near(self.points)

    def permits(self, places: npt.NDArray[np.floating[Any]]) -> Bool:
        """At which places (K, 3) a point may be added."""
        allowed = self._near(places)
        if self.constraints.keep_occlusion_order:
            allowed[allowed] = ~self.hidden(places[allowed])
        return allowed

    def project(self, offset_m: npt.NDArray[np.floating[Any]]) -> Float64:
        """The nearest displacements (N, 3) that the constraints allow; a length never grows.

        A point that may not be touched stays. Along the ray: the component of the displacement on it. A
        point that would come to stand behind a surface stays where it is.
        """
        offset = np.where(self.allowed[:, None], np.asarray(offset_m, np.float64), 0.0)
        if self.constraints.along_ray:
            offset = along_rays(self.points, offset)
        if self.constraints.keep_occlusion_order:
            moved = np.flatnonzero((offset != 0).any(axis=1))
            start = self.points[moved].astype(np.float64)
            covered = moved[self.hidden(start + offset[moved]) & ~self.hidden(start)]
            offset[covered] = 0.0
        return offset

    def limit(self, worth: npt.NDArray[np.floating[Any]]) -> Bool:
        """Which points (N,) to touch: the `max_points` of highest positive worth, the first of equals."""
        touched: Bool = worth > 0
        most = self.constraints.max_points
        if most is not None and touched.sum() > most:
            touched[np.argsort(-worth, kind="stable")[most:]] = False
        return touched

    def hidden(self, places: npt.NDArray[np.floating[Any]]) -> Bool:
        """Which places (K, 3) the surfaces of the clean cloud hide from the sensor.

        Those that stand more than `SAME_SURFACE_M` farther away than each of the four points of the cloud
        that are nearest to them in direction. Where no point lies within 1.5 degrees nothing hides.
        """
        range_m = np.linalg.norm(places, axis=1)
        direction = np.asarray(places, np.float64) / np.maximum(range_m, 1e-9)[:, None]
        tree, clean_range_m = self._directions
        if not len(clean_range_m) or not len(places):
            return np.zeros(len(places), bool)
        _, near = tree.query(direction, k=_NEIGHBOURS, distance_upper_bound=_NEIGHBOUR_RAD)
        # A neighbour that is missing has the index N.
        reach_m = np.append(clean_range_m, -np.inf)[near].max(axis=1)
        hidden: Bool = np.isfinite(reach_m) & (range_m > reach_m + SAME_SURFACE_M)
        return hidden

    @cached_property
    def _directions(self) -> tuple[Any, Float64]:
        points = self.points.astype(np.float64)
        range_m = np.linalg.norm(points, axis=1)
        return cKDTree(points / np.maximum(range_m, 1e-9)[:, None]), range_m

    def _near(self, places: npt.NDArray[np.floating[Any]]) -> Bool:
        """Which places (K, 3) lie near enough to the targeted boxes."""
        constraints = self.constraints
        margin_m = constraints.near_objects_m
        if margin_m is None and not (constraints.objects or constraints.ghost):
            return np.ones(len(places), bool)
        near = np.zeros(len(places), bool)
        targeted = constraints.attacked(self.boxes, self.points).geometry
        for inside in points_in_boxes(places, targeted, OBJECT_MARGIN_M if margin_m is None else margin_m):
            near[inside] = True
        return near


def _names(boxes: Boxes) -> Sequence[str]:
    """The names by which boxes are chosen: their ids, or their places if the truth has no ids."""
    return boxes.ids if any(boxes.ids) else [str(place) for place in range(len(boxes))]


def along_rays(points: Float32, offset_m: Float64) -> Float64:
    """The component of displacements (N, 3) along the rays from the origin to the points (N, 3)."""
    start = points.astype(np.float64)
    squared = np.maximum(np.square(start).sum(axis=1, keepdims=True), 1e-18)
    along: Float64 = (offset_m * start).sum(axis=1, keepdims=True) / squared * start
    return along
