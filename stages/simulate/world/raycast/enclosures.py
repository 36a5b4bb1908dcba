"""What encloses a garden: fences, railings and walls, each along x, the road on the side of positive y."""

from __future__ import annotations

import numpy as np

from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.shapes import limbs, upright

FOOT_M = -0.3
"""Posts and walls reach below the ground, which may slope."""

POST_STEP_M = 2.4
HEIGHT_M = {"picket": 1.0, "boards": 1.75, "mesh": 1.4, "railing": 1.25, "wall": 0.9, "high wall": 1.9}
"""Mean height of each kind."""

THICK_M = 0.4
"""Width of ground that each of them takes, its posts and coping included."""


def enclosure(kind: str, length_m: float, rng: np.random.Generator) -> Mesh:
    """A stretch of a kind of `HEIGHT_M`, which varies a little in height."""
    height_m = HEIGHT_M[kind] * rng.uniform(0.88, 1.12)
    if kind in ("wall", "high wall"):
        return _wall(length_m, height_m, rng)
    if kind == "picket":
        slats = _bars(length_m, height_m, 0.16, 0.09, "fence")
        return merge([slats, _rails(length_m, (0.25, height_m - 0.22), 0.07, "fence")])
    if kind == "boards":
        return _boards(length_m, height_m, rng)
    bars = _bars(length_m, height_m, 0.17, 0.02, "fence_metal") if kind == "railing" else None
    levels = (0.12, height_m - 0.08) if bars else np.linspace(0.08, height_m, 7)
    wires = _rails(length_m, levels, 0.04 if bars else 0.014, "fence_metal")
    return merge([wires, _posts(length_m, height_m, 0.06, "fence_metal"), *([bars] if bars else [])])


def _bars(length_m: float, height_m: float, step_m: float, width_m: float, material: str) -> Mesh:
    left = np.arange(-length_m / 2, length_m / 2 - width_m, step_m)
    return upright(np.stack(np.broadcast_arrays(left, left + width_m, 0.06, height_m), axis=1), 0.0, material)


def _rails(length_m: float, levels_m: tuple[float, ...] | np.ndarray, high_m: float, material: str) -> Mesh:
    sides = [(-length_m / 2, length_m / 2, z, z + high_m) for z in levels_m]
    return upright(sides, -0.03, material)


def _boards(length_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """Boards that overlap: every second one stands back."""
    edges = np.linspace(-length_m / 2, length_m / 2, max(round(length_m / 0.36), 1) + 1)
    top = height_m + rng.normal(0, 0.012, len(edges) - 1)
    sides = np.stack(np.broadcast_arrays(edges[:-1], edges[1:], 0.03, top), axis=1)
    back_m = 0.035 * (np.arange(len(sides)) % 2).astype(np.float64)
    return upright(sides, -back_m, "fence")


def _posts(length_m: float, height_m: float, side_m: float, material: str) -> Mesh:
    count = max(round(length_m / POST_STEP_M), 1) + 1
    reach_m = length_m / 2 - side_m
    foot = np.zeros((count, 3)) + (0, -0.08, FOOT_M)
    foot[:, 0] = np.linspace(-reach_m, reach_m, count)
    top = foot + (0, 0, height_m + 0.1 - FOOT_M)
    return limbs(foot, top, np.full(count, side_m / 2), material, sides=3, taper=1.0)


def _wall(length_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """A wall with a coping, and often with piers."""
    material = ("garden_wall", "masonry", "plaster")[int(rng.choice(3, p=(0.6, 0.25, 0.15)))]
    body = box_mesh((length_m, 0.2, height_m - FOOT_M), material).moved(0, 0, FOOT_M)
    coping = box_mesh((length_m, 0.3, 0.07), "barrier_concrete").moved(0, 0, height_m)
    piers = []
    if rng.random() < 0.6:
        pier = box_mesh((0.34, 0.34, height_m + 0.12 - FOOT_M), material).moved(0, 0, FOOT_M)
        count = max(round(length_m / 3.2), 1) + 1
        reach_m = (length_m - 0.34) / 2
        piers = [pier.moved(float(x), 0, 0) for x in np.linspace(-reach_m, reach_m, count)]
    return merge([body, coping, *piers])
