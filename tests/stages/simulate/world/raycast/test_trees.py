"""Crowns transmit some rays, have few triangles, and stay within bounds; signs shine to the front only."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast import furniture, leaves, trees
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.templates import TREES

LEAVED = (trees.broad_leaved, trees.slender, trees.columnar, trees.conifer, trees.shrub_tree)


@pytest.mark.parametrize("build", LEAVED)
def test_a_tree_crown_transmits_some_rays(build: trees.Tree) -> None:
    """Through the middle half of the crown, over ten trees: neither a wall nor thin air."""
    shares = []
    for seed in range(10):
        mesh = build(np.random.default_rng(seed))
        assert len(mesh.triangles) <= 300
        leafy = np.isin(mesh.materials, [MATERIAL_ID["foliage"], MATERIAL_ID["conifer"]])
        points = mesh.vertices_m[np.unique(mesh.triangles[leafy])]
        middle, half = points.mean(axis=0), points.std(axis=0)
        rng = np.random.default_rng(1)
        rays = np.zeros((2000, 6), np.float32)
        rays[:, 0], rays[:, 3] = -50.0, 1.0
        rays[:, 1:3] = middle[1:] + rng.uniform(-0.7, 0.7, (2000, 2)) * half[1:]
        shares.append(np.isinf(Scene(mesh).cast(rays).range_m).mean())
    assert 0.08 < np.mean(shares) < 0.6


@pytest.mark.parametrize("build", TREES)
def test_trees_have_the_size_of_trees(build: trees.Tree) -> None:
    for seed in range(10):
        points = build(np.random.default_rng(seed)).vertices_m
        assert 2.0 < points[:, 2].max() < 14.0
        assert np.abs(points[:, :2]).max() < 6.0
        assert points[:, 2].min() < 0


def test_street_trees_leave_room_for_people_and_cars() -> None:
    """No branch or leaf is lower than 2 m, but for the trunk."""
    for build in (trees.broad_leaved, trees.slender, trees.bare):
        for seed in range(10):
            points = build(np.random.default_rng(seed)).vertices_m
            low = points[points[:, 2] < 2.0]
            assert np.abs(low[:, :2]).max() < 0.6


def test_a_tree_in_winter_has_no_leaf() -> None:
    mesh = trees.bare(np.random.default_rng(0))
    assert set(mesh.materials.tolist()) == {MATERIAL_ID["bark"]}
    assert len(mesh.triangles) > 150


def test_a_hedge_is_uneven_and_keeps_its_size() -> None:
    mesh = leaves.hedge(8.0, 0.8, 1.5, np.random.default_rng(0))
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    assert np.all(np.abs(low[:2]) < (4.3, 0.75))
    assert 1.4 < high[2] < 1.9
    rays = np.zeros((2000, 6), np.float32)
    rng = np.random.default_rng(1)
    rays[:, 0], rays[:, 1], rays[:, 2] = rng.uniform(-3.8, 3.8, 2000), -9.0, rng.uniform(0.1, 1.3, 2000)
    rays[:, 4] = 1.0
    range_m = Scene(mesh).cast(rays).range_m
    assert np.isfinite(range_m).mean() > 0.99
    assert 0.02 < range_m.std() < 0.15


def test_a_sign_is_retroreflective_on_its_front_only() -> None:
    scene = Scene(furniture.traffic_sign(np.random.default_rng(3)))
    y, z = np.meshgrid(np.linspace(-0.8, 0.8, 60), np.linspace(1.9, 3.5, 60))
    rays = np.zeros((y.size, 6), np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 3] = -5, y.ravel(), z.ravel(), 1
    front = scene.cast(rays)
    rays[:, 0], rays[:, 3] = 5, -1
    back = scene.cast(rays)
    assert (front.materials[np.isfinite(front.range_m)] == MATERIAL_ID["sign"]).mean() > 0.6
    assert MATERIAL_ID["sign"] not in back.materials[np.isfinite(back.range_m)]
