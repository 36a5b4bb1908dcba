"""Clusters of leaves: bushes, hedges, ivy and tall grass."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge, surface
from advpipe.stages.simulate.world.raycast.shapes import quads

HEDGE_STEP_M = 0.9


def leaf_clusters(middles_m: Float64, side_m: float, material: str, rng: np.random.Generator) -> Mesh:
    """Equilateral triangles of this side around the middles (N, 3), randomly oriented."""
    count = len(middles_m)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = np.cross(normal, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    reach_m = side_m / np.sqrt(3) * rng.uniform(0.7, 1.25, (count, 1))
    a, b = reach_m * across, reach_m * np.cross(normal, across)
    turns = 2 * np.pi * np.arange(3) / 3
    corners = np.stack([middles_m + np.cos(turn) * a + np.sin(turn) * b for turn in turns], axis=1)
    corners[..., 2] = np.maximum(corners[..., 2], 0.02)
    return surface(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), material)


def bush(rng: np.random.Generator) -> Mesh:
    """A bush of up to 2 m, of two or three lobes."""
    radius_m = rng.uniform(0.4, 0.95)
    lobes = rng.normal(0, 0.3 * radius_m, (int(rng.integers(2, 4)), 2))
    size_m = radius_m * rng.uniform(0.5, 0.85, len(lobes))
    chosen = rng.integers(len(lobes), size=45)
    leaves = _ball(rng, 45) * (size_m[chosen, None] * (1, 1, rng.uniform(0.8, 1.3)))
    leaves[:, 2] = np.abs(leaves[:, 2]) + 0.35 * size_m[chosen]
    leaves[:, :2] += lobes[chosen]
    reach_m = np.linalg.norm(leaves[:, :2], axis=1, keepdims=True)
    leaves[:, :2] *= np.minimum(1, radius_m / np.maximum(reach_m, 1e-9))
    return leaf_clusters(leaves, 0.5 * radius_m, "foliage", rng)


def hedge(length_m: float, width_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """A clipped hedge along x: an uneven skin, and leaves that stick out of it."""
    along = max(round(length_m / HEDGE_STEP_M), 1) + 1
    profile = np.array([[-1, 0], [-1.05, 0.55], [-0.8, 1.0], [0.8, 1.0], [1.05, 0.55], [1, 0]])
    points = np.empty((along, len(profile), 3))
    points[..., 0] = np.linspace(-length_m / 2, length_m / 2, along)[:, None]
    points[..., 1:] = profile * (width_m / 2, height_m) + rng.normal(0, 0.045, (along, len(profile), 2))
    points[1:-1, :, 0] += rng.normal(0, 0.05, (max(along - 2, 0), len(profile)))
    points[:, [0, -1], 2] = -0.2
    sheet = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    ends = points[[0, -1]][:, [[0, 1, 4, 5], [1, 2, 3, 4]]]
    skin = quads(np.concatenate([sheet.reshape(-1, 4, 3), ends.reshape(-1, 4, 3)]), "foliage")
    count = int(2.6 * length_m * (height_m + 0.5 * width_m))
    places = rng.uniform(-0.5, 0.5, (count, 3))
    top = rng.random(count) < width_m / (width_m + 2 * height_m)
    places[~top, 1] = 0.5 * np.sign(places[~top, 1])
    places[top, 2] = 0.5
    leaves = (places + (0, 0, 0.5)) * (length_m - 0.2, width_m, height_m)
    return merge([skin, leaf_clusters(leaves, 0.3, "foliage", rng)])


def ivy(width_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """Ivy on a wall in the plane y = 0, on the side of positive y; denser at its foot."""
    count = int(6 * width_m * height_m)
    x = rng.uniform(-width_m / 2, width_m / 2, count)
    z = height_m * rng.random(count) ** 1.4
    leaves = np.stack([x * (1 - 0.4 * z / height_m), rng.uniform(0.03, 0.14, count), z], axis=1)
    return leaf_clusters(leaves, 0.38, "foliage", rng)


def tall_grass(rng: np.random.Generator) -> Mesh:
    """A tuft of rough grass or weeds, up to half a metre tall."""
    blades, height_m = 7, rng.uniform(0.15, 0.5)
    foot = rng.normal(0, 0.13, (blades, 3)) * (1, 1, 0)
    angle = rng.uniform(0, np.pi, blades)
    half = 0.13 * np.stack([np.cos(angle), np.sin(angle), np.zeros(blades)], axis=1)
    tip = foot + rng.normal(0, 0.1, (blades, 3)) * (1, 1, 0)
    tip[:, 2] = height_m * rng.uniform(0.6, 1.0, blades)
    foot[:, 2] = -0.1
    corners = np.stack([foot - half, foot + half, tip], axis=1)
    return surface(corners.reshape(-1, 3), np.arange(3 * blades).reshape(-1, 3), "tall_grass")


def _ball(rng: np.random.Generator, count: int) -> Float64:
    """Points (count, 3) in the unit ball, denser towards its surface, where the light is."""
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ball: Float64 = direction * rng.random((count, 1)) ** 0.25
    return ball
