"""Parcels of land along streets, one beside the other, each from the walkway backward."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.stages.simulate.road_network.roads import resample

BUILDING_LINE_M = 5.3
"""From the kerb to the front of the parcels, just behind the walkway."""

WIDTH_M = (9.0, 24.0)
CORNER_DEG = 25.0
SHORTEST_M = 4.0


@dataclass(frozen=True)
class Parcel:
    """front_m: the middle (3,) of its front, with the height of the road there. yaw_rad: direction of the
    front, the road on its left. slope: of the road."""

    front_m: Float64
    yaw_rad: float
    width_m: float
    slope: float = 0.0

    def at(self, along_m: float, back_m: float, z_m: float = 0.0) -> Float64:
        """The pose (4, 4) at a height in the map, `back_m` behind the front and `along_m` from its middle.

        Its y axis points to the road.
        """
        x, y = self.places(np.array([[along_m, back_m]]))[0]
        return se3_from_yaw((x, y, z_m), self.yaw_rad)

    def street_m(self, along_m: Float64) -> Float64:
        """Height (N,) of the street at distances (N,) from the middle of the front."""
        height_m: Float64 = self.front_m[2] + self.slope * along_m
        return height_m

    def places(self, along_back_m: Float64) -> Float64:
        """Places (N, 2) in the map of points (N, 2): along the front, and behind it."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along, outward = np.array([cos, sin]), np.array([sin, -cos])
        found: Float64 = self.front_m[:2] + along_back_m[:, :1] * along + along_back_m[:, 1:] * outward
        return found


def parcels_along(kerbs_m: tuple[Float64, ...], rng: np.random.Generator) -> Iterator[list[Parcel]]:
    """The parcels of each side of a block, in the order of its kerb."""
    for kerb in kerbs_m:
        if len(kerb) < 2:
            continue
        line = shapely.LineString(kerb[:, :2])
        for front in shapely.get_parts(line.offset_curve(-BUILDING_LINE_M, join_style="mitre")):
            if front.length < SHORTEST_M:
                continue
            points = np.array(front.simplify(0.15).coords)
            for side in _sides(points):
                yield list(_parcels(side, kerb, rng))


def _sides(points_m: Float64) -> Iterator[Float64]:
    """A polyline (K, 2) divided at its corners."""
    step = np.diff(points_m, axis=0)
    turn = np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0]))))
    corners = [0, *(np.flatnonzero(turn > np.deg2rad(CORNER_DEG)) + 1), len(points_m) - 1]
    for start, end in itertools.pairwise(corners):
        yield points_m[start : end + 1]


def _parcels(side_m: Float64, kerb_m: Float64, rng: np.random.Generator) -> Iterator[Parcel]:
    """Parcels whose fronts are chords of one side, without gaps."""
    side = resample(side_m, 1.0)
    ends = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])
    if ends[-1] < SHORTEST_M:
        return
    widths: list[float] = []
    while sum(widths) < ends[-1]:
        widths.append(rng.uniform(*WIDTH_M))
    if len(widths) > 1 and sum(widths) - ends[-1] > widths[-1] / 2:
        widths.pop()
    borders = np.concatenate([[0.0], np.cumsum(widths)]) * ends[-1] / sum(widths)
    corners = np.stack([np.interp(borders, ends, side[:, axis]) for axis in (0, 1)], axis=1)
    for a, b in itertools.pairwise(corners):
        width_m = float(np.linalg.norm(b - a))
        heights = [kerb_m[np.argmin(np.linalg.norm(kerb_m[:, :2] - end, axis=1)), 2] for end in (a, b)]
        if width_m >= SHORTEST_M:
            front = np.array([*(a + b) / 2, np.mean(heights)])
            yaw_rad = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
            yield Parcel(front, yaw_rad, width_m, float(heights[1] - heights[0]) / width_m)
