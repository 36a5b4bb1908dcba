"""Pedestrians who walk back and forth along the kerb, each at a constant speed."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.scenario.fleet import PEOPLE
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.roads import KERB_M, WALKWAY_OFFSET_M, Roads, offset_right, resample
from advpipe.stages.simulate.traffic.road_users import RoadUser

PIECE_M = 4.0
STRAY_M = 0.6
NEAR_ROUTE_M = 30.0
NEAR_ROUTE_SHARE = 0.5
"""Share of the pedestrians who walk near the instrumented vehicles' routes."""

COMPANION_SHARE, COMPANION_ASIDE_M = 0.3, 0.65
"""Share of the pedestrians who walk beside the one drawn before, and how far to their side."""

STILL_ASIDE_M = 1.1
"""Those who stay in one place do so this far from the middle of the walkway, out of the others' way."""


@dataclass(frozen=True)
class Walker:
    """A pedestrian who walks `path_m` (K, 3) from end to end and back; the pose depends on the time alone.

    start_m: distance along the path, there and back, at time 0. turn_rad: from the path's direction to where
    the pedestrian faces.
    """

    id: str
    variant: Variant
    path_m: Float64
    start_m: float
    speed_mps: float
    turn_rad: float = 0.0

    def at(self, time_s: float) -> RoadUser:
        """The pedestrian at a time since the recording's start."""
        ends_m, directions = self._segments
        length_m = ends_m[-1]
        walked_m = (self.start_m + self.speed_mps * time_s) % (2 * length_m)
        outward = walked_m < length_m
        place_m = walked_m if outward else 2 * length_m - walked_m
        index = min(bisect_right(ends_m, place_m), len(ends_m) - 1)
        position = self.path_m[index + 1] - directions[index] * (ends_m[index] - place_m)
        direction = directions[index] if outward else -directions[index]
        yaw_rad = math.atan2(direction[1], direction[0]) + self.turn_rad
        return RoadUser(self.id, self.variant, se3_from_yaw(position, yaw_rad), direction * self.speed_mps)

    @cached_property
    def _segments(self) -> tuple[list[float], Float64]:
        """The distance along the path of each segment's end, and the segments' directions (K - 1, 3)."""
        pieces = np.diff(self.path_m, axis=0)
        lengths = np.linalg.norm(pieces, axis=1)
        return np.cumsum(lengths).tolist(), pieces / lengths[:, None]


def draw_walkers(
    scenario: Scenario,
    roads: Roads,
    variants: dict[str, Variant],
    routes_m: list[Float64],
    pavements_m: Sequence[Float64] = (),
) -> list[Walker]:
    """The pedestrians of a scenario, some of them near the routes (K, 3) of its instrumented vehicles.

    They walk on the network's pavements (K, 3) if it has any, else beside the kerb. SUMO's pedestrians are
    not used, since they need pavements in the network, which most OpenDRIVE maps lack.
    """
    rng = named_generator(scenario.simulation.seed, "walkers")
    if pavements_m:
        aside_m, raised_m = 0.0, 0.0
        paths = [path for line in pavements_m for path in _paths(resample(line, PIECE_M))]
    else:
        aside_m, raised_m = WALKWAY_OFFSET_M, KERB_M
        paths = [path for kerb in roads.kerbs_m for path in _paths(kerb) if _has_room(path, roads)]
    if not paths or not routes_m:  # nobody would see them, and they carry no radio
        return []
    draw = _Draw(paths, routes_m, variants, rng)
    still_m = STRAY_M if pavements_m else STILL_ASIDE_M
    walkers: list[Walker] = []
    for index in range(scenario.traffic.pedestrians):
        way = draw.way(still_m)
        line_m = offset_right(way.path_m, aside_m + way.side_m) + (0, 0, raised_m)
        name = f"pedestrian.{index}"
        walkers.append(Walker(name, way.variant, line_m, way.start_m, way.speed_mps, way.turn_rad))
    return walkers


class _Way(NamedTuple):
    """Who goes where: columns as in Walker; side_m: to the right of the walkway's middle `path_m`."""

    variant: Variant
    path_m: Float64
    side_m: float
    start_m: float
    speed_mps: float
    turn_rad: float = 0.0


class _Draw:
    """Draws pedestrians one after the other; some walk beside the one before."""

    def __init__(
        self,
        paths: list[Float64],
        routes_m: list[Float64],
        variants: dict[str, Variant],
        rng: np.random.Generator,
    ) -> None:
        self._paths, self._rng = paths, rng
        self._lengths_m = np.array([np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths])
        middles = np.array([path[len(path) // 2, :2] for path in paths])
        route = np.concatenate(routes_m)[:, :2]
        distance_m = np.array([np.linalg.norm(route - middle, axis=1).min() for middle in middles])
        near = self._lengths_m * (distance_m < NEAR_ROUTE_M)
        self._near = near if near.sum() > 0 else self._lengths_m
        self._people = [variant for variant in variants.values() if variant.body.label == "pedestrian"]
        # A body of the user's is as frequent as the mean one of ours.
        shares = np.array([PEOPLE.get(one.body.name, 1 / len(PEOPLE)) for one in self._people])
        self._shares = shares / shares.sum()
        self._last: _Way | None = None

    def way(self, still_m: float) -> _Way:
        """The next pedestrian; one who stays in one place does so `still_m` aside."""
        rng, last = self._rng, self._last
        variant = self._people[int(rng.choice(len(self._people), p=self._shares))]
        if variant.body.still:
            way = self._new(variant)._replace(
                side_m=still_m, speed_mps=0.0, turn_rad=float(rng.uniform(-np.pi, np.pi))
            )
        elif last is not None and last.speed_mps > 0 and rng.random() < COMPANION_SHARE:
            beside_m = last.side_m - math.copysign(COMPANION_ASIDE_M, last.side_m)
            way = last._replace(variant=variant, side_m=beside_m)
        else:
            way = self._new(variant)
        self._last = way
        return way

    def _new(self, variant: Variant) -> _Way:
        rng = self._rng
        weights = self._near if rng.random() < NEAR_ROUTE_SHARE else self._lengths_m
        path = self._paths[int(rng.choice(len(self._paths), p=weights / weights.sum()))]
        side_m, start_m = rng.uniform(-STRAY_M, STRAY_M), rng.uniform(0, 2 * self._lengths_m.max())
        return _Way(variant, path, float(side_m), float(start_m), float(rng.uniform(0.8, 1.7)))


def _has_room(kerb_m: Float64, roads: Roads) -> bool:
    """Whether a walkway fits beside this kerb; on a narrow median, the next road takes its place."""
    offsets_m = (WALKWAY_OFFSET_M - STRAY_M, WALKWAY_OFFSET_M + STRAY_M)
    lines = [shapely.LineString(offset_right(kerb_m, offset_m)[:, :2]) for offset_m in offsets_m]
    return not any(roads.area.intersects(line.buffer(0.4)) for line in lines)


def _paths(kerb_m: Float64, points: int = 20) -> list[Float64]:
    """A kerb divided into paths of some 80 m."""
    starts = range(0, len(kerb_m) - 1, points)
    pieces = [kerb_m[start : start + points + 1] for start in starts]
    return [piece for piece in pieces if len(piece) >= 3 and np.ptp(piece[:, :2]) > 1.0]
