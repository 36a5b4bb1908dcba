"""Crowns transmit some rays and have few triangles; there are rooms behind windows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast import buildings, furniture, trees
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.scene import Scene


@pytest.mark.parametrize("build", [trees.round_tree, trees.conifer, trees.columnar_tree])
def test_a_tree_crown_transmits_some_rays(build: Callable[[np.random.Generator], Mesh]) -> None:
    """Through the middle half of the crown, over ten trees: neither a wall nor thin air."""
    shares = []
    for seed in range(10):
        mesh = build(np.random.default_rng(seed))
        assert len(mesh.triangles) <= 300
        leaves = np.isin(mesh.materials, [MATERIAL_ID["foliage"], MATERIAL_ID["conifer"]])
        points = mesh.vertices_m[np.unique(mesh.triangles[leaves])]
        middle, half = points.mean(axis=0), points.std(axis=0)
        rng = np.random.default_rng(1)
        rays = np.zeros((2000, 6), np.float32)
        rays[:, 0], rays[:, 3] = -50.0, 1.0
        rays[:, 1:3] = middle[1:] + rng.uniform(-0.7, 0.7, (2000, 2)) * half[1:]
        shares.append(np.isinf(Scene(mesh).cast(rays).range_m).mean())
    assert 0.08 < np.mean(shares) < 0.6


def test_rays_through_building_windows_hit_rooms() -> None:
    mesh = buildings.building(20.0, 12.0, 3, np.random.default_rng(0))
    scene = Scene(mesh)
    x, z = np.meshgrid(np.linspace(-9, 9, 120), np.linspace(0.2, 8.5, 80))
    rays = np.zeros((x.size, 6), np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2] = x.ravel() - 6.0, -30.0, z.ravel()
    rays[:, 3:5] = np.array([0.2, 1.0]) / np.hypot(0.2, 1.0)
    hits = scene.cast(rays)
    room = hits.materials == MATERIAL_ID["room"]
    assert 0.08 < room.mean() < 0.5
    assert np.all(hits.transmission[room & np.isfinite(hits.range_m)] < 1)
    wall_m = np.median(hits.range_m[~room])
    assert np.median(hits.range_m[room]) > wall_m + 1.0
    # Straight on, the panes answer themselves.
    rays[:, 0], rays[:, 3:5] = x.ravel(), (0, 1)
    assert MATERIAL_ID["pane"] in scene.cast(rays).materials


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
