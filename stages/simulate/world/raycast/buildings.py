"""Buildings: facades with windows that open into rooms, under flat, gabled or hipped roofs."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge, surface
from advpipe.stages.simulate.world.raycast.shapes import quad

STOREY_M = 3.0
ROOM_M = 3.5
"""Depth of the rooms behind the facade."""

FOOT_M = 1.5
"""How far walls reach below the ground, which may slope."""

WALLS = ("plaster", "masonry", "facade_concrete", "facade_dark")


def building(length_m: float, depth_m: float, storeys: int, rng: np.random.Generator) -> Mesh:
    """A building centred on its ground plan; its length is along x."""
    wall = WALLS[int(rng.choice(len(WALLS), p=(0.4, 0.35, 0.15, 0.1)))]
    height_m = storeys * STOREY_M + 0.6
    bay_m, window_m = rng.uniform(2.4, 3.6), rng.uniform(0.35, 0.65)
    parts = []
    for turn, (wide_m, deep_m) in enumerate([(length_m, depth_m), (depth_m, length_m)] * 2):
        facade = _facade(wide_m, height_m, storeys, bay_m, window_m, wall)
        pose = se3_from_yaw((0, 0, 0), turn * np.pi / 2)
        parts.append(facade.moved(0, -deep_m / 2, 0).transformed(pose))
    core = (max(length_m - 2 * ROOM_M, 0.5), max(depth_m - 2 * ROOM_M, 0.5), height_m)
    parts.append(box_mesh(core, "room"))
    for storey in range(storeys + 1):
        z_m = 0.15 + storey * STOREY_M
        parts.append(quad(_plan(length_m - 0.1, depth_m - 0.1, z_m), "room"))
    parts.append(_roof(length_m, depth_m, height_m, rng))
    return merge(parts)


def _facade(
    wide_m: float, height_m: float, storeys: int, bay_m: float, window_share: float, wall: str
) -> Mesh:
    """A wall in the x-z plane, seen from -y: strips between the storeys, piers between the windows."""
    bays = max(int(wide_m // bay_m), 1)
    pitch_m = wide_m / bays
    middles = (np.arange(bays) + 0.5) * pitch_m - wide_m / 2
    half_m = window_share * pitch_m / 2
    piers = np.concatenate(
        [[-wide_m / 2], *np.stack([middles - half_m, middles + half_m], axis=1), [wide_m / 2]]
    )
    walls, panes = [], []
    bottom = -FOOT_M
    for storey in range(storeys):
        sill, head = storey * STOREY_M + 1.0, storey * STOREY_M + 2.45
        walls.append((-wide_m / 2, wide_m / 2, bottom, sill))
        walls += [(a, b, sill, head) for a, b in zip(piers[::2], piers[1::2], strict=True)]
        panes += [(a, b, sill, head) for a, b in zip(piers[1::2], piers[2::2], strict=False)]
        bottom = head
    walls.append((-wide_m / 2, wide_m / 2, bottom, height_m))
    return merge([_rectangles(np.array(walls), 0.0, wall), _rectangles(np.array(panes), 0.0, "pane")])


def _rectangles(sides_m: Float64, y_m: float, material: str) -> Mesh:
    """Upright rectangles from their sides (N, 4): x from, x to, z from, z to."""
    a, b, low, high = sides_m.T
    y = np.full(len(a), y_m)
    corners = np.stack([(a, y, low), (b, y, low), (b, y, high), (a, y, high)]).transpose(2, 0, 1)
    first = 4 * np.arange(len(a))[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return surface(corners.reshape(-1, 3), faces, material)


def _plan(length_m: float, depth_m: float, z_m: float) -> list[tuple[float, float, float]]:
    x, y = length_m / 2, depth_m / 2
    return [(-x, -y, z_m), (x, -y, z_m), (x, y, z_m), (-x, y, z_m)]


def _roof(length_m: float, depth_m: float, z_m: float, rng: np.random.Generator) -> Mesh:
    """Flat, gabled, or hipped, its ridge along the longer side."""
    style = int(rng.integers(3))
    if style == 0:
        return quad(_plan(length_m, depth_m, z_m - 0.4), "facade_concrete")
    along_x = length_m >= depth_m
    long_m, short_m = max(length_m, depth_m) / 2 + 0.4, min(length_m, depth_m) / 2 + 0.4
    top_m = z_m + short_m * rng.uniform(0.5, 0.9)
    ridge_m = long_m if style == 1 else max(long_m - short_m, 0.5)
    points = np.array(
        [
            [-long_m, -short_m, z_m], [long_m, -short_m, z_m],
            [long_m, short_m, z_m], [-long_m, short_m, z_m],
            [-ridge_m, 0, top_m], [ridge_m, 0, top_m],
        ]
    )  # fmt: skip
    points = points if along_x else points[:, [1, 0, 2]]
    faces = [[0, 1, 5], [0, 5, 4], [2, 3, 4], [2, 4, 5], [1, 2, 5], [3, 0, 4]]
    return surface(points, faces, "roof_tile")
