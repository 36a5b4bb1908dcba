"""The area of the roads, level by level, and the height of their surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import cKDTree
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.network import RoadNetwork

KERB_M = 0.12
WALKWAY_OFFSET_M = 3.6
"""From the kerb to the middle of the pavement."""

FAST_MPS = 20.0
"""Beside faster roads there are guard rails, and neither pavements nor houses."""

MEDIAN_M = 5.0
CLEARANCE_M = 2.5
"""Roads that cross with more than this height difference are a bridge and the road below it."""

REACH_M = 1.5
"""Largest distance of a junction from the end of a lane that leads to it."""

SAMPLE_M = 2.0


@dataclass(frozen=True)
class RoadLevel:
    """The roads of one level; none of them lies above another.

    area: the union of their lanes and junctions in x, y. samples_m: points (S, 3) on their lanes. courses:
    (S, 3), unit direction and slope of the lane there. fast: (S,), whether it is a fast road. tree: of the
    points in x, y.
    """

    area: MultiPolygon
    samples_m: Float64
    courses: Float64
    fast: npt.NDArray[np.bool_]
    tree: cKDTree

    def height_at(self, xy_m: Float64) -> Float64:
        """Height (...,) in metres at places (..., 2), along the nearest lane's slope."""
        _, nearest = self.tree.query(xy_m)
        courses = self.courses[nearest]
        along_m = ((xy_m - self.samples_m[nearest, :2]) * courses[..., :2]).sum(axis=-1)
        heights: Float64 = (
            self.samples_m[nearest, 2] + np.clip(along_m, -SAMPLE_M, SAMPLE_M) * courses[..., 2]
        )
        return heights

    def covers(self, points_m: Float64) -> npt.NDArray[np.bool_]:
        """Which of the points (N, 3) lie on this level, within a metre of its height."""
        on = np.array(shapely.contains_xy(self.area, points_m[:, 0], points_m[:, 1]), dtype=np.bool_)
        on[on] = np.abs(self.height_at(points_m[on, :2]) - points_m[on, 2]) < 1.0
        return on


@dataclass(frozen=True)
class Roads:
    """All roads.

    area: the union of all lanes and junctions in x, y. levels: the lowest first.
    kerbs_m: polylines (K, 3) along streets with a pavement, the road on their left, closed around a
    block. verges_m: the same along fast roads and bridges, which have no pavement.
    medians: narrow islands between carriageways.
    """

    area: MultiPolygon
    levels: tuple[RoadLevel, ...]
    kerbs_m: tuple[Float64, ...]
    verges_m: tuple[Float64, ...]
    medians: MultiPolygon
    is_flat: bool

    def height_at(self, xy_m: Float64) -> Float64:
        """Height (...,) in metres of the nearest lane at places (..., 2); the lowest level wins within 6
        m."""
        if len(self.levels) == 1:
            return self.levels[0].height_at(xy_m)
        distance_m = np.stack([level.tree.query(xy_m)[0] for level in self.levels])
        best = np.argmin(np.maximum(distance_m, 6.0), axis=0)
        heights = np.stack([level.height_at(xy_m) for level in self.levels])
        chosen: Float64 = np.take_along_axis(heights, best[None], axis=0)[0]
        return chosen


def lay_out_roads(network: RoadNetwork) -> Roads:
    """Compute the outlines of all lanes and junctions; gaps of less than two metres are closed."""
    turns_m = [turn.centre_m for edge in network.edges.values() for turn in edge.connections]
    turns_m = [turn for turn in turns_m if len(turn) > 1]
    middles_m = np.array([turn[len(turn) // 2, :2] for turn in turns_m]).reshape(-1, 2)
    pieces, lines, fast = [], [], []
    for edge in network.edges.values():
        ribbons = [
            shapely.LineString(lane.centre_m[:, :2]).buffer(
                lane.width_m / 2, cap_style="flat", join_style="mitre"
            )
            for lane in edge.lanes
        ]
        pieces.append(shapely.unary_union(ribbons))
        lines.append([lane.centre_m for lane in edge.lanes])
        fast.append(edge.speed_mps > FAST_MPS)
    rapid = [edge for edge in network.edges.values() if edge.speed_mps > FAST_MPS]
    ends = [lane.centre_m[[0, -1], :2] for edge in rapid for lane in edge.lanes]
    fast_ends = shapely.points(np.concatenate(ends)) if ends else np.array([])
    for outline in network.junctions_m:
        area = shapely.make_valid(Polygon(outline[:, :2]))
        shapely.prepare(area)
        inside = [
            turns_m[i] for i in np.flatnonzero(shapely.contains_xy(area, middles_m[:, 0], middles_m[:, 1]))
        ]
        pieces.append(area)
        lines.append(inside or [np.concatenate([outline, outline[:1]])])
        fast.append(bool(np.any(shapely.distance(area, fast_ends) < REACH_M)))
    heights = np.concatenate([line[:, 2] for group in lines for line in group])
    is_flat = bool(np.ptp(heights) < 0.01)
    level_of = np.zeros(len(pieces), np.int64) if is_flat else _level_of_pieces(pieces, lines)
    levels = tuple(
        _build_level([(pieces[i], lines[i], fast[i]) for i in np.flatnonzero(level_of == number)])
        for number in range(level_of.max() + 1)
    )
    union = shapely.unary_union([level.area for level in levels])
    medians = _medians(levels[0].area)
    kerbs, verges = _edges(levels)
    return Roads(_multi(union), levels, kerbs, verges, medians, is_flat)


def _level_of_pieces(
    pieces: Sequence[shapely.Geometry], lines: Sequence[list[Float64]]
) -> npt.NDArray[np.int64]:
    """The level (N,) of each piece of road: a bridge is one level above the road below it."""
    trees = [np.concatenate([resample(line, SAMPLE_M) for line in group]) for group in lines]
    index = shapely.STRtree(list(pieces))
    above = []
    for a, b in index.query(list(pieces), predicate="intersects").T:
        if a >= b or (shared := pieces[a].intersection(pieces[b])).area < 1.0:
            continue
        place = np.array(shared.representative_point().coords[0])
        z_a, z_b = (
            float(points[np.argmin(np.linalg.norm(points[:, :2] - place, axis=1)), 2])
            for points in (trees[a], trees[b])
        )
        if abs(z_a - z_b) > CLEARANCE_M:
            above.append((a, b) if z_a > z_b else (b, a))
    levels = np.zeros(len(pieces), np.int64)
    for _ in range(8):
        for upper, lower in above:
            levels[upper] = max(levels[upper], levels[lower] + 1)
    return np.minimum(levels, 8)


def _build_level(group: list[tuple[shapely.Geometry, list[Float64], bool]]) -> RoadLevel:
    area = shapely.unary_union([piece for piece, _, _ in group]).buffer(1.0, join_style="mitre")
    area = _multi(area.buffer(-1.0, join_style="mitre").simplify(0.03))
    lines = [resample(line, SAMPLE_M) for _, group_lines, _ in group for line in group_lines]
    fast = [is_fast for _, group_lines, is_fast in group for _ in group_lines]
    samples = np.concatenate(lines)
    courses = np.concatenate([_courses(line) for line in lines])
    is_fast = np.repeat(fast, [len(line) for line in lines])
    return RoadLevel(area, samples, courses, is_fast, cKDTree(samples[:, :2]))


def _courses(line_m: Float64) -> Float64:
    step = np.gradient(line_m, axis=0)
    courses: Float64 = step / np.maximum(np.linalg.norm(step[:, :2], axis=1, keepdims=True), 1e-9)
    return courses


def _multi(area: shapely.Geometry) -> MultiPolygon:
    parts = [part for part in shapely.get_parts(area) if isinstance(part, Polygon)]
    return MultiPolygon(parts)


def _medians(area: MultiPolygon) -> MultiPolygon:
    holes = [Polygon(ring) for polygon in area.geoms for ring in polygon.interiors]
    return MultiPolygon([hole for hole in holes if hole.buffer(-MEDIAN_M / 2).is_empty])


def _edges(levels: tuple[RoadLevel, ...]) -> tuple[tuple[Float64, ...], tuple[Float64, ...]]:
    """Kerbs and verges: the outlines of the levels, without the seams where one continues as another."""
    kerbs: list[Float64] = []
    verges: list[Float64] = []
    for number, level in enumerate(levels):
        for polygon in level.area.geoms:
            oriented = orient(polygon)
            for ring in (oriented.exterior, *oriented.interiors):
                xy = resample(np.array(ring.coords)[:, :2], 4.0)
                line = np.column_stack([xy, level.height_at(xy)])
                middle = (line[1:] + line[:-1]) / 2
                beside = (offset_right(line, 0.4)[1:] + offset_right(line, 0.4)[:-1]) / 2
                seam = np.zeros(len(middle), np.bool_)
                for other in levels:
                    if other is not level:
                        seam |= other.covers(beside)
                plain = level.fast[level.tree.query(middle[:, :2])[1]] | (number > 0)
                kerbs += _runs(line, ~seam & ~plain)
                verges += _runs(line, ~seam & plain)
    return tuple(kerbs), tuple(verges)


def _runs(line_m: Float64, wanted: npt.NDArray[np.bool_]) -> list[Float64]:
    """The stretches of a polyline (K, 3) whose pieces (K - 1,) are wanted."""
    if wanted.all():
        return [line_m]
    ends = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(np.int8)))
    return [line_m[start : end + 1] for start, end in zip(ends[::2], ends[1::2], strict=True)]


def resample(line_m: Float64, spacing_m: float) -> Float64:
    """A polyline (K, D) with extra points so that no piece is longer than the spacing."""
    pieces = []
    for a, b in pairwise(line_m):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / spacing_m)))
        pieces.append(a + (b - a) * np.arange(count)[:, None] / count)
    return np.concatenate([*pieces, line_m[-1:]])


def offset_right(line_m: Float64, offset_m: float) -> Float64:
    """A polyline (K, 3) moved to its right in x, y."""
    step = np.gradient(line_m[:, :2], axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9)
    moved = line_m.copy()
    moved[:, :2] += offset_m * np.column_stack([step[:, 1], -step[:, 0]])
    return moved
