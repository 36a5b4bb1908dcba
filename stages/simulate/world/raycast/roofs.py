"""Roofs: flat ones with a parapet, gables and hips with eaves, dormers, chimneys."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge, surface
from advpipe.stages.simulate.world.raycast.shapes import quads

THICK_M = 0.18


def roof(
    length_m: float,
    depth_m: float,
    z_m: float,
    wall: str,
    rng: np.random.Generator,
    *,
    joined: bool,
    flat: bool,
) -> Mesh:
    """A roof on walls of height `z_m`; joined: the house stands in a row, so that no eaves reach sideways."""
    if flat:
        return _flat(length_m, depth_m, z_m, wall, rng)
    if joined or length_m >= depth_m or rng.random() < 0.4:
        return _pitched(length_m, depth_m, z_m, wall, rng, joined)
    turned = _pitched(depth_m, length_m, z_m, wall, rng, False)
    return Mesh(turned.vertices_m[:, [1, 0, 2]] * (-1, 1, 1), turned.triangles, turned.materials)


def _flat(length_m: float, depth_m: float, z_m: float, wall: str, rng: np.random.Generator) -> Mesh:
    """A flat roof behind the top of the walls, with a stair head or machines on it."""
    lid = quads([_plan(length_m, depth_m, z_m - 0.4)], "facade_concrete")
    size = (rng.uniform(1.5, 3.5), rng.uniform(1.5, 3.0), rng.uniform(1.2, 2.8))
    aside = rng.uniform(-0.3, 0.3, 2) * (length_m - size[0], depth_m - size[1])
    return merge([lid, box_mesh(size, wall).moved(float(aside[0]), float(aside[1]), z_m - 0.4)])


def _pitched(
    length_m: float, depth_m: float, z_m: float, wall: str, rng: np.random.Generator, joined: bool
) -> Mesh:
    """A ridge along x over eaves; gables or hips at its ends; dormers towards +y; a chimney."""
    eaves_m = rng.uniform(0.3, 0.65)
    pitch = rng.uniform(0.55, 1.0)
    x, y = length_m / 2 + (0.0 if joined else 0.35), depth_m / 2 + eaves_m
    foot_m, top_m = z_m - pitch * eaves_m, z_m + pitch * depth_m / 2
    hipped = not joined and rng.random() < 0.3
    ridge = max(x - 0.8 * y, 0.4) if hipped else x
    points = np.array(
        [
            [-x, -y, foot_m],
            [x, -y, foot_m],
            [x, y, foot_m],
            [-x, y, foot_m],
            [-ridge, 0, top_m],
            [ridge, 0, top_m],
        ]
    )
    faces = [[0, 1, 5], [0, 5, 4], [2, 3, 4], [2, 4, 5]]
    hips = [[1, 2, 5], [3, 0, 4]] if hipped else []
    below = points - (0, 0, THICK_M)
    parts = [surface(points, faces + hips, "roof_tile"), surface(below, faces, "wood")]
    rim = [[points[a], points[b], below[b], below[a]] for a, b in ((0, 1), (2, 3))]
    parts.append(quads(rim, "frame_white"))
    if not hipped:
        gable = np.array([[0, -depth_m / 2, z_m], [0, depth_m / 2, z_m], [0, 0, top_m]])
        parts += [surface(gable + (side * length_m / 2, 0, 0), [[0, 1, 2]], wall) for side in (-1, 1)]
    parts += _dormers(ridge, depth_m, z_m, pitch, wall, rng)
    if rng.random() < 0.75:
        at = rng.uniform(-0.6, 0.6) * ridge, rng.uniform(-0.15, 0.15) * depth_m
        stack = box_mesh((rng.uniform(0.5, 1.1), 0.5, 1.9), "masonry")
        parts.append(stack.moved(float(at[0]), float(at[1]), top_m - 1.1))
    return merge(parts)


def _dormers(
    ridge_m: float, depth_m: float, z_m: float, pitch: float, wall: str, rng: np.random.Generator
) -> list[Mesh]:
    """Dormers on the slope towards the street, where the roof is high enough."""
    if pitch * depth_m / 2 < 3.0 or rng.random() < 0.45:
        return []
    count = max(int(ridge_m / 2.2), 1) if ridge_m > 1.2 else 1
    middles = np.linspace(-0.75, 0.75, count) * ridge_m if count > 1 else np.zeros(1)
    y, foot = depth_m / 2 - 0.7, z_m + 0.3
    back = y - 1.6 / pitch
    body = [
        [(-0.7, y, foot), (0.7, y, foot), (0.7, y, foot + 0.5), (-0.7, y, foot + 0.5)],
        *([(s, y, foot), (s, back, foot), (s, back, foot + 1.7), (s, y, foot + 1.7)] for s in (-0.7, 0.7)),
    ]
    pane = [[(-0.6, y, foot + 0.5), (0.6, y, foot + 0.5), (0.6, y, foot + 1.6), (-0.6, y, foot + 1.6)]]
    inside = [[(-0.7, back, foot), (0.7, back, foot), (0.7, back, foot + 1.7), (-0.7, back, foot + 1.7)]]
    lid = [
        [
            (-0.9, y + 0.2, foot + 1.6),
            (0, y + 0.2, foot + 2.1),
            (0, back - 0.6, foot + 2.1),
            (-0.9, back, foot + 1.6),
        ],
        [
            (0.9, y + 0.2, foot + 1.6),
            (0, y + 0.2, foot + 2.1),
            (0, back - 0.6, foot + 2.1),
            (0.9, back, foot + 1.6),
        ],
    ]
    one = merge([quads(body, wall), quads(pane, "pane"), quads(inside, "room"), quads(lid, "roof_tile")])
    return [one.moved(float(x), 0, 0) for x in middles]


def _plan(length_m: float, depth_m: float, z_m: float) -> Float64:
    x, y = length_m / 2, depth_m / 2
    return np.array([(-x, -y, z_m), (x, -y, z_m), (x, y, z_m), (-x, y, z_m)])
