"""Houses: rooms of different depth behind their windows, facades with relief, sizes within bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast.buildings import draw_style, garage, house, shed
from advpipe.stages.simulate.world.raycast.enclosures import HEIGHT_M, THICK_M, enclosure
from advpipe.stages.simulate.world.raycast.facades import BULGE_M, STEPS_M, facade
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.scene import Scene

INSIDE = [MATERIAL_ID[name] for name in ("room", "room_light", "curtain")]


def into(mesh: Mesh, aside: float, wide_m: float, high_m: float):
    """Rays from the street into a front, at a slant of `aside`."""
    x, z = np.meshgrid(np.linspace(-0.48, 0.48, 160) * wide_m, np.linspace(0.2, high_m, 80))
    rays = np.zeros((x.size, 6), np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2] = x.ravel() - 20 * aside, 20.0, z.ravel()
    rays[:, 3:5] = np.array([aside, -1.0]) / np.hypot(aside, 1.0)
    return rays, Scene(mesh).cast(rays)


def test_rays_through_windows_hit_rooms_of_different_depth() -> None:
    rng = np.random.default_rng(0)
    style = replace(draw_style(3, rng), curtains=0.0, balconies=0.0)
    mesh = facade(20.0, 12.0, style, rng, is_front=True)
    rays, hits = into(mesh, 0.2, 20.0, style.height_m)
    inside = np.isin(hits.materials, INSIDE) & np.isfinite(hits.range_m)
    assert 0.08 < inside.mean() < 0.5
    assert np.all(hits.transmission[inside] < 1)
    depth_m = -(rays[:, 1] + hits.range_m * rays[:, 4])[inside]
    assert depth_m.min() > 0.05
    assert depth_m.max() < 6.0
    assert np.ptp(np.percentile(depth_m, [10, 90])) > 1.0
    # Straight on, the panes answer themselves.
    assert MATERIAL_ID["pane"] in into(mesh, 0.0, 20.0, style.height_m)[1].materials


def test_no_two_houses_are_alike_inside() -> None:
    style = draw_style(2, np.random.default_rng(5))
    found = []
    for seed in range(4):
        mesh = house(12.0, 9.0, style, np.random.default_rng(seed))
        rooms = np.isin(mesh.materials, INSIDE)
        found.append(np.sort(np.round(mesh.vertices_m[np.unique(mesh.triangles[rooms]), 1], 3)).tolist())
    assert all(a != b for index, a in enumerate(found) for b in found[:index])


def test_facades_have_depth() -> None:
    """Their nearest surfaces, rooms left aside, are spread over more than 10 cm."""
    rng = np.random.default_rng(2)
    style = draw_style(3, rng)
    rays, hits = into(facade(18.0, 10.0, style, rng, is_front=True), 0.0, 18.0, style.height_m)
    y_m = rays[:, 1] + hits.range_m * rays[:, 4]
    shell = ~np.isin(hits.materials, INSIDE) & np.isfinite(y_m)
    assert (y_m[shell] > 0.04).mean() > 0.02
    assert (y_m[shell] < -0.08).mean() > 0.1


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize("storeys", [1, 3, 5])
def test_houses_keep_to_their_plan(storeys: int, joined: bool) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        mesh = house(11.0, 9.0, draw_style(storeys, rng), rng, joined=joined)
        points = mesh.vertices_m
        low = points[points[:, 2] < 2.2]
        assert low[:, 1].max() <= 4.5 + max(STEPS_M, BULGE_M) + 1e-6
        assert low[:, 1].min() >= -4.5 - 0.1
        assert np.abs(low[:, 0]).max() <= 5.5 + (1e-6 if joined else 0.1)
        assert storeys * 2.9 < points[:, 2].max() < storeys * 2.9 + 9.0
        assert len(mesh.triangles) < 2600


@pytest.mark.parametrize("kind", list(HEIGHT_M))
def test_enclosures_keep_their_size(kind: str) -> None:
    for seed in range(5):
        points = enclosure(kind, 6.0, np.random.default_rng(seed)).vertices_m
        assert np.abs(points[:, 0]).max() <= 3.0 + 1e-6
        assert np.abs(points[:, 1]).max() <= THICK_M / 2
        assert 0.8 * HEIGHT_M[kind] < points[:, 2].max() < 1.2 * HEIGHT_M[kind] + 0.15


def test_open_fences_let_rays_pass_and_closed_ones_do_not() -> None:
    rays = np.zeros((4000, 6), np.float32)
    rng = np.random.default_rng(0)
    rays[:, 0], rays[:, 1], rays[:, 2] = rng.uniform(-2.9, 2.9, 4000), 5.0, rng.uniform(0.1, 0.7, 4000)
    rays[:, 4] = -1.0
    passed = {
        kind: np.isinf(Scene(enclosure(kind, 6.0, np.random.default_rng(1))).cast(rays).range_m).mean()
        for kind in HEIGHT_M
    }
    assert passed["boards"] == passed["wall"] == passed["high wall"] == 0
    assert passed["mesh"] > 0.75
    assert 0.6 < passed["railing"] < 0.95
    assert 0.2 < passed["picket"] < 0.6


def test_garages_and_sheds_are_small() -> None:
    for build, size_m in ((garage, (3.4, 6.3)), (shed, (2.4, 2.9))):
        points = build(np.random.default_rng(0)).vertices_m
        assert np.all(np.ptp(points[:, :2], axis=0) <= size_m)
        assert points[:, 2].max() < 3.2
