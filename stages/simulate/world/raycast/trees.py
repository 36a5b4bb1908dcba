"""Trees and bushes: crowns of leaf clusters with gaps that let some rays through."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge, surface, tube

CLUSTERS = 225
LEAF_SHARE = 0.28
"""Side of a leaf cluster, a triangle, as a share of the crown's radius r. A randomly oriented sheet has
half its area in projection, so that `CLUSTERS` of them spread over pi r^2 let exp(-n sqrt(3) s^2 / 8 pi),
some 30 %, of the light through."""


def round_tree(rng: np.random.Generator) -> Mesh:
    """A broad-leaved tree: a bare trunk, a few boughs, an ellipsoid of leaves."""
    trunk_m, crown_m = rng.uniform(2.0, 3.2), rng.uniform(1.3, 2.8)
    tall_m = crown_m * rng.uniform(0.9, 1.3)
    middle_m = trunk_m + 0.8 * tall_m
    trunk = tube((0, 0, -0.3), (0, 0, middle_m), rng.uniform(0.1, 0.25), "bark", 6)
    boughs = []
    for angle in rng.uniform(0, 2 * np.pi, 3):
        reach = 0.6 * crown_m * np.array([np.cos(angle), np.sin(angle)])
        end = (*reach, middle_m + rng.uniform(0, 0.5))
        boughs.append(tube((0, 0, trunk_m), end, 0.06, "bark", 4))
    leaves = _ball(rng, CLUSTERS) * (crown_m, crown_m, tall_m) + (0, 0, middle_m)
    return merge([trunk, *boughs, _clusters(leaves, LEAF_SHARE * crown_m, "foliage", rng)])


def conifer(rng: np.random.Generator) -> Mesh:
    """A conifer: branches from near the ground, narrowing to the tip."""
    height_m, foot_m = rng.uniform(5.0, 11.0), rng.uniform(1.1, 1.9)
    up = 1 - np.sqrt(rng.random(CLUSTERS))  # evenly over the cone's surface
    angle, depth = rng.uniform(0, 2 * np.pi, CLUSTERS), rng.uniform(0.6, 1.0, CLUSTERS)
    radius = foot_m * (1 - up) * depth
    leaves = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.6 + up * (height_m - 0.6)])
    trunk = tube((0, 0, -0.3), (0, 0, 0.9 * height_m), 0.13, "bark", 6)
    return merge([trunk, _clusters(leaves, 0.45 * foot_m, "conifer", rng)])


def columnar_tree(rng: np.random.Generator) -> Mesh:
    """A slender tree such as a poplar."""
    height_m, radius_m = rng.uniform(6.0, 13.0), rng.uniform(0.6, 1.0)
    leaves = _ball(rng, CLUSTERS) * (radius_m, radius_m, 0.45 * height_m) + (0, 0, 0.58 * height_m)
    trunk = tube((0, 0, -0.3), (0, 0, 0.8 * height_m), 0.15, "bark", 6)
    return merge([trunk, _clusters(leaves, 0.45 * radius_m, "foliage", rng)])


def bush(rng: np.random.Generator) -> Mesh:
    """A round bush of up to 2 m."""
    radius_m = rng.uniform(0.4, 1.1)
    leaves = _ball(rng, 90) * (radius_m, radius_m, 0.8 * radius_m) + (0, 0, 0.6 * radius_m)
    leaves[:, 2] = np.abs(leaves[:, 2])
    return _clusters(leaves, 0.5 * radius_m, "foliage", rng)


def hedge(length_m: float, width_m: float, height_m: float, rng: np.random.Generator) -> Mesh:
    """A clipped hedge: leaves over its sides and top, a few of them askew."""
    count = int(min(290, 40 * length_m * height_m))
    places = rng.uniform(-0.5, 0.5, (count, 3))
    side = rng.integers(5, size=count)
    places[side < 4, 1] = np.sign(places[side < 4, 1]) * rng.uniform(0.38, 0.5, int((side < 4).sum()))
    places[side == 4, 2] = 0.5
    leaves = (places + (0, 0, 0.5)) * (length_m, width_m, height_m)
    return _clusters(leaves, 0.4, "foliage", rng)


def _ball(rng: np.random.Generator, count: int) -> Float64:
    """Points (count, 3) in the unit ball, denser towards its surface, where the light is."""
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    ball: Float64 = direction * rng.random((count, 1)) ** 0.25
    return ball


def _clusters(middles_m: Float64, side_m: float, material: str, rng: np.random.Generator) -> Mesh:
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
