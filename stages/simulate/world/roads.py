"""The ground: road surface with markings, kerbs and pavements along its outline, and grass beyond."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.polygon import orient
from shapely.ops import substring

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.network import RoadNetwork
from advpipe.stages.simulate.world.mesh import Mesh, merge, strip, surface

KERB_M = 0.12
PAVEMENT_M = 5.0
MARKING_WIDTH_M = 0.14
MARKING_HEIGHT_M = 0.004
GROUND_CELL_M = 6.5
GROUND_MARGIN_M = 130.0


@dataclass(frozen=True)
class Roads:
    """Where the roads are.

    area: the union of all lanes and junctions in x, y.
    kerbs_m: closed polylines (K, 3) around that area, the road on their left.
    """

    area: MultiPolygon
    kerbs_m: tuple[Float64, ...]
    tree: cKDTree
    heights_m: Float64

    def height_at(self, xy_m: Float64) -> Float64:
        """Height of the nearest lane at places (..., 2): (...,)."""
        _, nearest = self.tree.query(xy_m)
        heights: Float64 = self.heights_m[nearest]
        return heights


def lay_out_roads(network: RoadNetwork) -> Roads:
    """The outline of all lanes and junctions; gaps of under two metres are closed."""
    lanes = [lane for edge in network.edges.values() for lane in edge.lanes]
    ribbons = [
        shapely.LineString(lane.centre_m[:, :2]).buffer(
            lane.width_m / 2, cap_style="flat", join_style="mitre"
        )
        for lane in lanes
    ]
    crossings = [shapely.make_valid(Polygon(outline[:, :2])) for outline in network.junctions_m]
    area = shapely.unary_union([*ribbons, *crossings]).buffer(1.0, join_style="mitre")
    area = area.buffer(-1.0, join_style="mitre").simplify(0.03)
    area = area if isinstance(area, MultiPolygon) else MultiPolygon([area])
    centres = np.concatenate([resample(lane.centre_m, 4.0) for lane in lanes])
    tree = cKDTree(centres[:, :2])
    kerbs = []
    for polygon in area.geoms:
        oriented = orient(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            line = resample(np.array(ring.coords), 4.0)
            _, nearest = tree.query(line[:, :2])
            kerbs.append(np.column_stack([line[:, :2], centres[nearest, 2]]))
    return Roads(area, tuple(kerbs), tree, centres[:, 2])


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


def build_roads(network: RoadNetwork, roads: Roads, rng: np.random.Generator) -> Mesh:
    """Everything flat: asphalt, markings, kerbs, pavements and the ground around."""
    return merge(
        [
            _polygons(roads.area, roads, "asphalt", 0.0),
            _polygons(roads.area.buffer(PAVEMENT_M).difference(roads.area), roads, "concrete", KERB_M),
            *(_kerb(line) for line in roads.kerbs_m),
            *_markings(network),
            _ground(roads, rng),
        ]
    )


def _polygons(area: shapely.Geometry, roads: Roads, material: str, raise_m: float) -> Mesh:
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.segmentize(area, 20.0)))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    vertices = np.column_stack([corners, roads.height_at(corners) + raise_m])
    return surface(vertices, np.arange(len(vertices)).reshape(-1, 3), material)


def _kerb(line_m: Float64) -> Mesh:
    return strip(line_m + (0, 0, KERB_M), line_m, "concrete")


def _markings(network: RoadNetwork) -> list[Mesh]:
    """A solid line at both sides of every edge, dashes (3 m on, 6 m off) between its lanes."""
    lines = []
    for edge in network.drivable:
        for index, lane in enumerate(edge.lanes):
            inward = MARKING_WIDTH_M
            if index == 0:
                lines.append(_line(offset_right(lane.centre_m, lane.width_m / 2 - inward)))
            left = offset_right(
                lane.centre_m, -lane.width_m / 2 + (inward if lane is edge.lanes[-1] else 0.0)
            )
            lines.extend([_line(left)] if lane is edge.lanes[-1] else _dashes(left))
    return lines


def _line(centre_m: Float64) -> Mesh:
    raised = centre_m + (0, 0, MARKING_HEIGHT_M)
    half = MARKING_WIDTH_M / 2
    return strip(offset_right(raised, -half), offset_right(raised, half), "marking")


def _dashes(centre_m: Float64) -> list[Mesh]:
    line = shapely.LineString(centre_m)
    starts = np.arange(1.0, max(line.length - 3.0, 0.0), 9.0)
    pieces = [substring(line, start, start + 3.0) for start in starts]
    return [_line(np.array(piece.coords)) for piece in pieces if len(piece.coords) > 1]


def _ground(roads: Roads, rng: np.random.Generator) -> Mesh:
    """Uneven grass, a little below the roads, as far as `GROUND_MARGIN_M` or twice that from them."""
    per_block = round(GROUND_MARGIN_M / GROUND_CELL_M)
    blocks = np.unique(np.floor(roads.tree.data / GROUND_MARGIN_M).astype(np.int64), axis=0)
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(-1, 2)
    blocks = np.unique((blocks[:, None] + around).reshape(-1, 2), axis=0)
    within = np.stack(np.meshgrid(*[np.arange(per_block)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = (blocks[:, None] * per_block + within).reshape(-1, 2)
    corners = (cells[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])).reshape(-1, 2)
    nodes, node_of_corner = np.unique(corners, axis=0, return_inverse=True)
    xy_m = nodes * GROUND_CELL_M
    z_m = roads.height_at(xy_m) - 0.03 - 0.09 * rng.random(len(nodes))
    quads = node_of_corner.reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return surface(np.column_stack([xy_m, z_m]), triangles, "grass")
