"""The ground: road surface, kerbs, pavements along them, islands, and uneven grass beyond."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import Delaunay

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import KERB_M, RoadLevel, Roads, offset_right, resample
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge, strip, surface
from advpipe.stages.simulate.world.raycast.shapes import triangulated
from advpipe.stages.simulate.world.raycast.terrain import GROUND_CELL_M, Terrain

PAVEMENT_M = ((0.0, 2.35, "paving"), (2.35, 3.0, "grass"), (3.0, 5.0, "concrete"))
"""From the kerb outward: parking bays, a verge with lamp posts, the walkway."""

SKIRT_M = 0.9
"""Thickness of a bridge's deck."""

GROUND_MARGIN_M = 130.0

Height = Callable[[Float64], Float64]


def build_ground(network: RoadNetwork, roads: Roads, terrain: Terrain, rng: np.random.Generator) -> Mesh:
    """The surfaces of roads, pavements, islands and grass as one mesh in the map's frame."""
    lowest = roads.levels[0]
    piece_m = 20.0 if roads.is_flat else 4.0
    parts = []
    if roads.is_flat:
        parts.append(_sheet(lowest.area, lowest.height_at, "asphalt", 0.0, piece_m))
    else:
        parts += _ribbons(network)
        parts += [_junction(outline, roads) for outline in network.junctions_m]
    kerbs = [line for line in roads.kerbs_m if len(line) > 1]
    streets = shapely.unary_union([shapely.LineString(line[:, :2]) for line in kerbs])
    # A pavement continues below a bridge, and ends where a road of another level begins.
    spans = [
        level.area.difference(level.area.intersection(lowest.area).buffer(-0.5).buffer(8.5))
        for level in roads.levels[1:]
    ]
    taken = shapely.unary_union([lowest.area, roads.medians, *spans])
    for inner_m, outer_m, material in PAVEMENT_M:
        ring = (
            streets.buffer(outer_m).difference(streets.buffer(inner_m))
            if inner_m
            else streets.buffer(outer_m)
        )
        parts.append(_sheet(ring.difference(taken), lowest.height_at, material, KERB_M, piece_m))
    parts.append(_sheet(roads.medians, lowest.height_at, "grass", KERB_M, piece_m))
    parts += [strip(line + (0, 0, KERB_M), line, "kerbstone") for line in kerbs]
    for level in roads.levels[1:]:
        parts += _bridge_sides(level, roads)
    parts.append(_grass(roads, terrain, rng))
    return merge(parts)


def _sheet(area: shapely.Geometry, height_at: Height, material: str, raise_m: float, piece_m: float) -> Mesh:
    if area.is_empty:
        return merge([])
    corners = triangulated(shapely.segmentize(area, piece_m)).reshape(-1, 2)
    vertices = np.column_stack([corners, height_at(corners) + raise_m])
    return surface(vertices, np.arange(len(vertices)).reshape(-1, 3), material)


def _ribbons(network: RoadNetwork) -> list[Mesh]:
    """The surface of each lane, at the height of its centre line, on which the traffic drives."""
    ribbons = []
    for edge in network.edges.values():
        for lane in edge.lanes:
            line = resample(lane.centre_m, 5.0)
            half_m = lane.width_m / 2 + 0.02
            ribbons.append(strip(offset_right(line, -half_m), offset_right(line, half_m), "asphalt"))
    return ribbons


def _junction(outline_m: Float64, roads: Roads) -> Mesh:
    """A junction's surface through its outline and the lanes across it."""
    area = shapely.make_valid(shapely.Polygon(outline_m[:, :2]))
    if area.area < 0.1:  # a dead end
        return merge([])
    level = _level_at(outline_m, roads)
    line = resample(np.concatenate([outline_m, outline_m[:1]]), 4.0)[:-1]
    border = np.column_stack([line[:, :2], level.height_at(line[:, :2])])
    lanes = level.samples_m[
        shapely.contains_xy(area.buffer(-0.3), level.samples_m[:, 0], level.samples_m[:, 1])
    ]
    points = np.concatenate([border, lanes])
    # Keep one point per decimetre: the samples of crossing lanes nearly coincide.
    _, first = np.unique(np.round(points[:, :2], 1), axis=0, return_index=True)
    points = points[np.sort(first)]
    faces = Delaunay(points[:, :2] - points[0, :2]).simplices.astype(np.int64)
    middles = points[faces, :2].mean(axis=1)
    inside = shapely.contains_xy(area.buffer(0.05), middles[:, 0], middles[:, 1])
    return surface(points, faces[inside], "asphalt")


def _level_at(points_m: Float64, roads: Roads) -> RoadLevel:
    errors = [np.abs(level.height_at(points_m[:, :2]) - points_m[:, 2]).mean() for level in roads.levels]
    near = [level.tree.query(points_m[:, :2])[0].min() for level in roads.levels]
    return roads.levels[int(np.argmin(np.array(errors) + 10.0 * (np.array(near) > 6.0)))]


def _bridge_sides(level: RoadLevel, roads: Roads) -> list[Mesh]:
    """The edge beams of a road level that spans another."""
    lines = [
        line
        for line in roads.verges_m
        if len(line) > 1 and np.abs(level.height_at(line[:, :2]) - line[:, 2]).max() < 0.3
    ]
    return [strip(line + (0, 0, KERB_M), line - (0, 0, SKIRT_M), "barrier_concrete") for line in lines]


def _grass(roads: Roads, terrain: Terrain, rng: np.random.Generator) -> Mesh:
    """Uneven grass, a little below the roads, as far as `GROUND_MARGIN_M` or twice that from them."""
    per_block = round(GROUND_MARGIN_M / GROUND_CELL_M)
    places = np.concatenate([level.samples_m[:, :2] for level in roads.levels])
    blocks = np.unique(np.floor(places / GROUND_MARGIN_M).astype(np.int64), axis=0)
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 2)
    blocks = np.unique((blocks[:, None] + around).reshape(-1, 2), axis=0)
    within = np.stack(np.meshgrid(*[np.arange(per_block)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = (blocks[:, None] * per_block + within).reshape(-1, 2)
    corners = (cells[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])).reshape(-1, 2)
    nodes, node_of_corner = np.unique(corners, axis=0, return_inverse=True)
    xy_m = nodes * GROUND_CELL_M
    z_m = terrain.at(xy_m) - 0.03 - 0.09 * rng.random(len(nodes))
    quads = node_of_corner.reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return surface(np.column_stack([xy_m, z_m]), triangles, "grass")
