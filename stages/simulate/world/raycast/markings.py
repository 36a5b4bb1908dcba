"""Road markings (lane lines, stop lines, crossings) and patches of repaired asphalt."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.ops import substring

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.network import Edge, RoadNetwork
from advpipe.stages.simulate.road_network.roads import FAST_MPS, offset_right
from advpipe.stages.simulate.world.raycast.mesh import Mesh, strip

WIDTH_M = 0.14
HEIGHT_M = 0.004
PATCH_HEIGHT_M = 0.002
STOP_LINE_M = 0.4
CROSSING_M = (0.9, 3.4)
"""Where a crossing begins and ends beyond the end of the lanes, inside the junction."""

STRIPE_M = 0.5
PAVEMENT_M = 1.9
"""Paved width of a pedestrian lane."""


def build_markings(network: RoadNetwork, rng: np.random.Generator) -> list[Mesh]:
    """Lines beside every edge and between its lanes; at signals, stop lines and crossings."""
    signalled = [edge for edge in network.drivable if has_signal(edge)]
    leaving = {turn.to_edge for edge in signalled for turn in edge.connections if turn.light}
    meshes = []
    for edge in network.drivable:
        material = "marking_worn" if rng.random() < 0.3 else "marking"
        meshes += _lines(edge, material)
        meshes += _patches(edge, rng)
        if has_signal(edge):
            meshes += _crossing(edge, True, material)
        if edge.id in leaving:
            meshes += _crossing(edge, False, material)
    for pavement in network.pavements_m:
        meshes.append(_line(pavement, "paving", PAVEMENT_M, PATCH_HEIGHT_M))
    return meshes


def has_signal(edge: Edge) -> bool:
    """Whether the edge leads to a traffic light."""
    return any(turn.light is not None for turn in edge.connections)


def _lines(edge: Edge, material: str) -> list[Mesh]:
    on_m, off_m = (6.0, 12.0) if edge.speed_mps > FAST_MPS else (3.0, 6.0)
    lines = []
    for index, lane in enumerate(edge.lanes):
        if index == 0:
            lines.append(_line(offset_right(lane.centre_m, lane.width_m / 2 - WIDTH_M), material))
        is_last = lane is edge.lanes[-1]
        left = offset_right(lane.centre_m, -lane.width_m / 2 + (WIDTH_M if is_last else 0.0))
        lines.extend([_line(left, material)] if is_last else _dashes(left, on_m, off_m, material))
    return lines


def _line(centre_m: Float64, material: str, width_m: float = WIDTH_M, raise_m: float = HEIGHT_M) -> Mesh:
    raised = centre_m + (0, 0, raise_m)
    return strip(offset_right(raised, -width_m / 2), offset_right(raised, width_m / 2), material)


def _dashes(centre_m: Float64, on_m: float, off_m: float, material: str) -> list[Mesh]:
    line = shapely.LineString(centre_m)
    starts = np.arange(1.0, max(line.length - on_m, 0.0), on_m + off_m)
    pieces = [substring(line, start, start + on_m) for start in starts]
    return [_line(np.array(piece.coords), material) for piece in pieces if len(piece.coords) > 1]


def _crossing(edge: Edge, at_end: bool, material: str) -> list[Mesh]:
    """A stop line across the lanes that lead to a signal, and the stripes of a crossing beyond."""
    meshes = []
    for lane in edge.lanes:
        if not lane.for_cars:
            continue
        ends = lane.centre_m[[-2, -1]] if at_end else lane.centre_m[[1, 0]]
        ahead = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-9)
        if at_end:
            stop = np.stack([ends[1] - (0.2 + STOP_LINE_M) * ahead, ends[1] - 0.2 * ahead])
            meshes.append(_line(stop, material, lane.width_m - 0.2))
        stripe = ends[1] + np.array(CROSSING_M)[:, None] * ahead
        for aside_m in np.arange(-lane.width_m / 2 + STRIPE_M, lane.width_m / 2, 2 * STRIPE_M):
            meshes.append(_line(offset_right(stripe, aside_m), material, STRIPE_M))
    return meshes


def _patches(edge: Edge, rng: np.random.Generator) -> list[Mesh]:
    """Repaired stretches of a lane, newer or older than the rest."""
    meshes = []
    for lane in edge.lanes:
        line = shapely.LineString(lane.centre_m)
        for start in rng.random(rng.poisson(line.length / 70.0)) * line.length:
            piece = np.array(substring(line, start, start + rng.uniform(2.0, 12.0)).coords)
            width_m = lane.width_m * rng.uniform(0.3, 0.85)
            material = "asphalt_new" if rng.random() < 0.6 else "asphalt_old"
            if len(piece) > 1:
                meshes.append(_line(piece, material, width_m, PATCH_HEIGHT_M))
    return meshes
