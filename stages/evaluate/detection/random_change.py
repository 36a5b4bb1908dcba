"""Random changes of a cloud under an attack's budget, in draws whose parts can be put together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.baselines import move_within, random_directions
from advpipe.pipeline.defences.base import with_xyz
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference
from advpipe.stages.evaluate.detection.displacement import added_distance_m

Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]

REGION_M = 2.0
"""A change this far from an object's box may still matter to it."""


@dataclass(frozen=True)
class SpentBudget:
    """What an attack spent on a cloud.

    removed, added: how many points. moved_m: (K,) how far each of the moved points went. reach_m: how far
    from the point that it starts at a new one may lie. bound_m: how far any point was allowed to move.
    intensity_changed: how many points got another intensity.
    """

    removed: int
    added: int
    moved_m: Float64
    reach_m: float
    bound_m: float
    intensity_changed: int = 0

    @classmethod
    def of(
        cls, clean: Cloud, adversarial: Cloud, change: CloudDifference, parameters: Mapping[str, object]
    ) -> SpentBudget:
        """The budget as spent; lengths are bounded as the attack states, in its `eps_cm` or `eps_m`.

        An attack that states none was bounded by the longest way that it went.
        """
        stated_m = stated_bound_m(parameters)
        return cls(
            len(change.removed),
            len(change.added),
            change.displacement_m,
            added_distance_m(clean, adversarial, change) if stated_m is None else stated_m,
            change.max_displacement_m if stated_m is None else stated_m,
            len(change.intensity_changed),
        )


def stated_bound_m(parameters: Mapping[str, object]) -> float | None:
    """How far an attack with these parameters may move a point, or put a new one from where it starts."""
    for name, unit_m in (("eps_cm", 0.01), ("eps_m", 1.0)):
        value = parameters.get(name)
        if isinstance(value, int | float):
            return value * unit_m
    return None


@dataclass(frozen=True)
class DrawnChange:
    """One try: which points (indices into the clean cloud) go, which move and where, where new ones start,
    and which get what intensity."""

    removed: Int64
    moved: Int64
    move_m: Float64
    sources: Int64
    add_m: Float64
    intensity_changed: Int64
    intensity: Float64


class RandomChange:
    """Draws changes that spend a budget exactly, uniformly over the points of `pool`, then over the rest.

    The first draw decides how much of the budget each region (the surroundings of one object, or what is
    near none) gets; every try spends that again inside each region. So the region of one try can be put
    together with that of another, and the budget stays the same to the point. Intensities are drawn
    uniformly between the lowest and the highest of the clean cloud, which is all that an attack is held to.
    """

    def __init__(
        self, cloud: Cloud, boxes: Float64, budget: SpentBudget, pool: Bool, rng: np.random.Generator
    ) -> None:
        self.cloud, self.n_regions = cloud, len(boxes)
        self._points, self._budget, self._rng = xyz(cloud), budget, rng
        finite = np.asarray(np.isfinite(self._points).all(axis=1))
        region = regions(self._points, boxes)
        # Points outside the pool are in groups of their own: a try takes no more of them than the first draw.
        self._group = np.where(pool, region, region + self.n_regions + 1)
        self._members = {
            int(group): np.flatnonzero((self._group == group) & finite) for group in np.unique(self._group)
        }
        moved_m = rng.permutation(budget.moved_m)
        self._first = {
            "removed": self._group[_choose(pool & finite, ~pool & finite, budget.removed, rng)],
            "moved": self._group[_choose(pool & finite, ~pool & finite, len(moved_m), rng)],
            "added": self._group[_choose_again(pool & finite, finite, budget.added, rng)],
            "intensity_changed": self._group[
                _choose(pool & finite, ~pool & finite, budget.intensity_changed, rng)
            ],
        }
        self._moved_m = moved_m[: len(self._first["moved"])]
        known = cloud["intensity"][finite & np.isfinite(cloud["intensity"])]
        self._intensities = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)

    def draw(self) -> DrawnChange:
        """One try."""
        removed, moved, intensity_changed = (
            self._inside(self._first[what], again=False) for what in ("removed", "moved", "intensity_changed")
        )
        sources = self._inside(self._first["added"], again=True)
        radius_m = self._budget.reach_m * self._rng.random(len(sources)) ** (1 / 3)
        return DrawnChange(
            removed,
            moved,
            random_directions(len(moved), self._rng) * self._moved_m[:, None],
            sources,
            random_directions(len(sources), self._rng) * radius_m[:, None],
            intensity_changed,
            self._rng.uniform(*self._intensities, len(intensity_changed)),
        )

    def together(self, draws: list[DrawnChange], chosen: Int64) -> DrawnChange:
        """Of each region r its part of the draw `chosen[r]` (M,); of what is near no object, the first."""
        take = np.append(chosen, 0)  # region -1, near none, is the last

        def pick(what: str, arrays: list[npt.NDArray[np.generic]]) -> npt.NDArray[np.generic]:
            of = take[self._region_of(self._first[what])]
            return np.stack(arrays)[of, np.arange(len(of))] if len(of) else arrays[0]

        return DrawnChange(
            np.asarray(pick("removed", [each.removed for each in draws]), np.int64),
            np.asarray(pick("moved", [each.moved for each in draws]), np.int64),
            np.asarray(pick("moved", [each.move_m for each in draws]), np.float64),
            np.asarray(pick("added", [each.sources for each in draws]), np.int64),
            np.asarray(pick("added", [each.add_m for each in draws]), np.float64),
            np.asarray(pick("intensity_changed", [each.intensity_changed for each in draws]), np.int64),
            np.asarray(pick("intensity_changed", [each.intensity for each in draws]), np.float64),
        )

    def apply(self, change: DrawnChange) -> Cloud:
        """The cloud after a change; as stored in float32, no point goes farther than it may."""
        points = self._points.copy()
        points[change.moved] = move_within(points[change.moved], change.move_m)
        new = self.cloud[change.sources]
        new = with_xyz(new, move_within(self._points[change.sources], change.add_m))
        changed = with_xyz(self.cloud, points)
        changed["intensity"][change.intensity_changed] = change.intensity
        return np.concatenate([np.delete(changed, change.removed), new])

    def _inside(self, groups: Int64, *, again: bool) -> Int64:
        """A point of each of these groups (K,); none is taken twice, except `again`."""
        points = np.zeros(len(groups), np.int64)
        for group in np.unique(groups):
            places = np.flatnonzero(groups == group)
            points[places] = self._rng.choice(self._members[int(group)], size=len(places), replace=again)
        return points

    def _region_of(self, groups: Int64) -> Int64:
        """The region of each group: a number of a box, or -1."""
        return np.where(groups >= self.n_regions, groups - self.n_regions - 1, groups)


def regions(points: npt.NDArray[np.float32], boxes: Float64) -> Int64:
    """Which of the boxes (M, 7) each of the points (N, 3) is near, the nearest of several; -1 for none."""
    region = np.full(len(points), -1, dtype=np.int64)
    nearest = np.full(len(points), np.inf)
    for number, inside in enumerate(points_in_boxes(points, boxes, REGION_M)):
        distance = np.linalg.norm(points[inside].astype(np.float64) - boxes[number, :3], axis=1)
        closer = distance < nearest[inside]
        region[inside[closer]], nearest[inside[closer]] = number, distance[closer]
    return region


def _choose(pool: Bool, rest: Bool, count: int, rng: np.random.Generator) -> Int64:
    """`count` different points of the pool, and of the rest what the pool lacks; no more than there are."""
    first, then = np.flatnonzero(pool), np.flatnonzero(rest)
    inside = min(count, len(first))
    outside = min(count - inside, len(then))
    return np.concatenate(
        [rng.choice(first, size=inside, replace=False), rng.choice(then, size=outside, replace=False)]
    ).astype(np.int64)


def _choose_again(pool: Bool, every: Bool, count: int, rng: np.random.Generator) -> Int64:
    """`count` points of the pool, or of all if that is empty; one may be taken more than once."""
    points = np.flatnonzero(pool if pool.any() else every)
    return rng.choice(points, size=count) if len(points) else np.zeros(0, np.int64)
