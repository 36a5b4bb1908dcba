"""Trees: a trunk, boughs and branches that carry leaves in clusters, with gaps that let some rays through."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.leaves import leaf_clusters
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.shapes import limbs

LEAVES = 120
"""Leaf clusters of a crown, each a triangle."""

Tree = Callable[[np.random.Generator], Mesh]


class Limbs(NamedTuple):
    """N boughs or branches: starts and ends (N, 3), radii (N,) at the start, in metres."""

    starts_m: Float64
    ends_m: Float64
    radii_m: Float64

    def mesh(self, sides: int = 3) -> Mesh:
        return limbs(self.starts_m, self.ends_m, self.radii_m, "bark", sides)


def broad_leaved(rng: np.random.Generator) -> Mesh:
    """A tree with spreading boughs; its crown is as uneven as they are."""
    trunk_m, reach_m = rng.uniform(2.8, 3.7), rng.uniform(1.4, 2.2)
    trunk = _trunk(trunk_m + 1.0, rng.uniform(0.1, 0.2), rng)
    boughs = _forks(trunk, 7, reach_m, rng.uniform(1.3, 2.4), rng, (0.65, 1.0))
    twigs = _forks(boughs, 3, 0.6 * reach_m, 1.0, rng, (0.25, 1.0))
    leaves = _along(twigs, LEAVES, 0.15 * reach_m, rng)
    leaves[:, 2] = np.maximum(leaves[:, 2], trunk_m + 0.1)
    wood = [trunk.mesh(5), boughs.mesh(), twigs.mesh(2)]
    return merge([*wood, leaf_clusters(leaves, 0.39 * reach_m, "foliage", rng)])


def slender(rng: np.random.Generator) -> Mesh:
    """A birch or a young street tree: a thin stem all the way up, short branches that hang a little."""
    height_m, reach_m = rng.uniform(6.0, 9.5), rng.uniform(0.9, 1.5)
    stem = _trunk(height_m, rng.uniform(0.07, 0.12), rng)
    branches = _whorls(stem, 20, reach_m, 0.25, (0.36, 0.97), rng, 1.5)
    leaves = _along(branches, LEAVES, 0.2 * reach_m, rng) - (0, 0, 0.12)
    leaves[:, 2] = np.maximum(leaves[:, 2], 2.9)
    return merge([stem.mesh(5), branches.mesh(2), leaf_clusters(leaves, 0.48 * reach_m, "foliage", rng)])


def columnar(rng: np.random.Generator) -> Mesh:
    """A poplar or a hornbeam: branches that rise steeply along the stem."""
    height_m, reach_m = rng.uniform(7.0, 12.0), rng.uniform(0.7, 1.1)
    stem = _trunk(0.85 * height_m, 0.15, rng)
    branches = _whorls(stem, 18, reach_m, 1.6, (0.2, 0.95), rng, 1.2)
    leaves = _along(branches, LEAVES + 20, 0.24 * reach_m, rng)
    return merge([stem.mesh(5), branches.mesh(2), leaf_clusters(leaves, 0.62 * reach_m, "foliage", rng)])


def conifer(rng: np.random.Generator) -> Mesh:
    """A spruce or a pine: whorls of level branches, shorter towards the tip, some of them missing."""
    height_m, reach_m = rng.uniform(5.0, 11.0), rng.uniform(1.2, 2.0)
    stem = _trunk(height_m, 0.13, rng)
    branches = _whorls(stem, 34, reach_m, -0.15, (rng.uniform(0.08, 0.3), 0.98), rng, 1.0)
    leaves = _along(branches, LEAVES, 0.1 * reach_m, rng)
    return merge([stem.mesh(4), branches.mesh(2), leaf_clusters(leaves, 0.48 * reach_m, "conifer", rng)])


def bare(rng: np.random.Generator) -> Mesh:
    """A tree in winter: boughs, branches and twigs without a leaf."""
    trunk_m, reach_m = rng.uniform(3.1, 3.9), rng.uniform(1.4, 2.2)
    trunk = _trunk(trunk_m, rng.uniform(0.12, 0.22), rng)
    boughs = _forks(trunk, 6, reach_m, 1.2, rng, (0.75, 1.0))
    branches = _forks(boughs, 3, 0.7 * reach_m, 0.8, rng, (0.4, 1.0))
    twigs = _forks(branches, 4, 0.4 * reach_m, 0.5, rng, (0.3, 1.0))
    return merge([trunk.mesh(5), boughs.mesh(), branches.mesh(2), twigs.mesh(2)])


def shrub_tree(rng: np.random.Generator) -> Mesh:
    """A small tree of a garden: several stems from the ground, leaves from 1 m up."""
    reach_m = rng.uniform(0.9, 1.5)
    foot = Limbs(np.array([[0.0, 0, -0.4]]), np.array([[0.0, 0, -0.1]]), np.array([0.12]))
    stems = _forks(foot, 4, 0.6 * reach_m, 1.5 * reach_m + 0.5, rng, (0.5, 1.0))
    twigs = _forks(stems, 4, 0.7 * reach_m, 0.5, rng, (0.45, 1.0))
    leaves = _along(twigs, 100, 0.16 * reach_m, rng)
    return merge([stems.mesh(), twigs.mesh(2), leaf_clusters(leaves, 0.46 * reach_m, "foliage", rng)])


def _trunk(height_m: float, radius_m: float, rng: np.random.Generator) -> Limbs:
    """A stem that leans a little."""
    top = np.array([[*(0.03 * height_m * rng.normal(size=2)), height_m]])
    return Limbs(np.array([[0.0, 0.0, -0.3]]), top, np.array([radius_m]))


def _forks(
    of: Limbs, count: int, reach_m: float, rise_m: float, rng: np.random.Generator, part: tuple[float, float]
) -> Limbs:
    """`count` limbs from each of the given ones, from a part of their length on, in all directions."""
    parents = np.repeat(np.arange(len(of.radii_m)), count)
    share = rng.uniform(*part, (len(parents), 1))
    starts = of.starts_m[parents] + share * (of.ends_m - of.starts_m)[parents]
    angle = (
        rng.uniform(0, 2 * np.pi) + 2 * np.pi * (np.arange(len(parents)) + rng.uniform(-0.35, 0.35)) / count
    )
    length = reach_m * rng.uniform(0.55, 1.15, len(parents))
    away = np.stack([length * np.cos(angle), length * np.sin(angle), np.zeros(len(parents))], axis=1)
    away[:, 2] = rise_m * rng.uniform(0.35, 1.3, len(parents))
    ahead = (of.ends_m - of.starts_m)[parents] * (1, 1, 0)
    return Limbs(starts, starts + away + 0.35 * ahead, 0.5 * of.radii_m[parents])


def _whorls(
    stem: Limbs,
    count: int,
    reach_m: float,
    rise: float,
    part: tuple[float, float],
    rng: np.random.Generator,
    narrowing: float,
) -> Limbs:
    """Branches along a stem, shorter towards its top; rise: their slope."""
    up = np.sort(rng.uniform(0, 1, count)) ** 1.1
    share = part[0] + up * (part[1] - part[0])
    starts = stem.starts_m + share[:, None] * (stem.ends_m - stem.starts_m)
    length = reach_m * np.maximum(1 - up**narrowing, 0.12) * rng.uniform(0.6, 1.15, count)
    angle = 2.4 * np.arange(count) + rng.normal(0, 0.4, count)
    away = np.stack([length * np.cos(angle), length * np.sin(angle), rise * length], axis=1)
    return Limbs(starts, starts + away, np.full(count, 0.25 * stem.radii_m[0]))


def _along(of: Limbs, count: int, stray_m: float, rng: np.random.Generator) -> Float64:
    """Points (count, 3) about the outer parts of limbs, more of them on the long ones."""
    long_m = np.linalg.norm(of.ends_m - of.starts_m, axis=1)
    chosen = rng.choice(len(long_m), count, p=long_m / long_m.sum())
    share = rng.uniform(0.25, 1.1, (count, 1))
    points: Float64 = of.starts_m[chosen] + share * (of.ends_m - of.starts_m)[chosen]
    return points + rng.normal(0, stray_m, (count, 3))
