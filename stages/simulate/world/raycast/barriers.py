"""Guard rails, concrete walls and railings along the edge of the road."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.roads import KERB_M, Roads, offset_right
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge, strip
from advpipe.stages.simulate.world.raycast.occupied import Occupied

STRETCH_POINTS = 10
"""Length of one barrier in points of a kerb, about 40 m."""

FAST_SHARE = 0.95
OFFSET_M = 0.45
POST_M = (0.1, 0.12, 0.75)


def build_barriers(share: float, roads: Roads, occupied: Occupied, rng: np.random.Generator) -> list[Mesh]:
    """Barriers beside a share of the stretches of streets; if `share` is positive, also beside most fast
    roads."""
    meshes = []
    for lines, probability in (
        (roads.verges_m, max(share, FAST_SHARE) if share else 0.0),
        (roads.kerbs_m, share),
    ):
        is_street = lines is roads.kerbs_m
        builders = (_railing, _guard_rail) if is_street else (_guard_rail, _guard_rail, _wall)
        for line in lines:
            build = builders[int(rng.integers(len(builders)))]
            for stretch in _stretches(line):
                if rng.random() >= probability:
                    continue
                path = offset_right(stretch, OFFSET_M) + (0, 0, KERB_M if is_street else 0.0)
                if is_street and not occupied.take_line(path, 0.2):
                    continue
                meshes.append(build(path))
    return meshes


def _stretches(line_m: Float64) -> Iterator[Float64]:
    for start in range(0, len(line_m) - 1, STRETCH_POINTS):
        yield line_m[start : start + STRETCH_POINTS + 1]


def _guard_rail(path_m: Float64) -> Mesh:
    """A steel beam of two waves, 0.75 m high, on posts 4 m apart."""
    profile = [(0.0, 0.75), (0.08, 0.68), (0.0, 0.6), (0.08, 0.52), (0.0, 0.44)]
    return merge([*_extruded(path_m, profile, "rail"), *_posts(path_m, POST_M)])


def _wall(path_m: Float64) -> Mesh:
    """A concrete wall with the New Jersey profile, 0.81 m high."""
    profile = [(0.4, 0.0), (0.2, 0.33), (0.15, 0.81), (-0.05, 0.81), (-0.1, 0.33), (-0.3, 0.0)]
    return merge(_extruded(path_m, profile, "barrier_concrete"))


def _railing(path_m: Float64) -> Mesh:
    """A pedestrian railing of two bars."""
    bars = [(0.0, 1.0), (0.0, 0.94)], [(0.0, 0.55), (0.0, 0.5)]
    return merge(
        [*(m for bar in bars for m in _extruded(path_m, bar, "rail")), *_posts(path_m, (0.06, 0.06, 1.0))]
    )


def _extruded(path_m: Float64, profile: list[tuple[float, float]], material: str) -> list[Mesh]:
    """A profile of points (towards the road, up), in metres, extruded along a path."""
    lines = [offset_right(path_m, -toward) + (0, 0, up) for toward, up in profile]
    return [strip(a, b, material) for a, b in pairwise(lines)]


def _posts(path_m: Float64, size_m: tuple[float, float, float]) -> list[Mesh]:
    post = box_mesh((size_m[0], size_m[1], size_m[2] + 0.3), "rail")
    return [post.moved(x, y, z - 0.3) for x, y, z in offset_right(path_m, 0.1)]
