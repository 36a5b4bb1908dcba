"""Bodies fill their boxes, stand on the ground, are closed to rays from the side and open through glass."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.stages.simulate.bodies import BODIES, PAINTS, VARIANTS, Variant, draw_variants
from advpipe.stages.simulate.world.raycast.body_meshes import (
    MIRROR_OUT_M,
    SHAPES,
    body_mesh,
    body_meshes,
    hull,
)
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID, RETROREFLECTIVE
from advpipe.stages.simulate.world.raycast.scene import Scene

VEHICLES = [name for name, body in BODIES.items() if body.label in ("car", "truck")]


def of_its_size(name: str) -> Variant:
    """The body at its nominal size, in red."""
    body = BODIES[name]
    return Variant(f"{name}.0", body, body.length_m, body.width_m, body.height_m, "paint_red")


@pytest.mark.parametrize("name", BODIES)
def test_a_body_without_mirrors_fills_its_box_exactly(name: str) -> None:
    body = BODIES[name]
    mesh = hull(of_its_size(name))
    half = np.array([body.length_m / 2, body.width_m / 2])
    assert np.allclose(mesh.vertices_m.min(axis=0), [*-half, 0], atol=1e-9)
    assert np.allclose(mesh.vertices_m.max(axis=0), [*half, body.height_m], atol=1e-9)
    assert body.label in CLASSES


@pytest.mark.parametrize("name", BODIES)
def test_only_mirrors_exceed_the_box_and_meshes_are_small(name: str) -> None:
    body = BODIES[name]
    mesh = body_mesh(of_its_size(name))
    out_m = MIRROR_OUT_M if SHAPES[name].mirrors else 0.0
    reach = np.abs(mesh.vertices_m).max(axis=0)
    assert reach == pytest.approx([body.length_m / 2, body.width_m / 2 + out_m, body.height_m], abs=1e-9)
    assert len(mesh.triangles) <= 1000
    assert (SHAPES[name].mirrors is not None) == (name in VEHICLES)


@pytest.mark.parametrize("name", BODIES)
def test_a_ray_from_the_side_hits_the_body_within_its_box(name: str) -> None:
    body = BODIES[name]
    scene = Scene(body_mesh(of_its_size(name)))
    places = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 21), np.linspace(0.2, 0.95, 21)), -1).reshape(-1, 2)
    rays = np.array(
        [[x * body.length_m, 10.0, z * body.height_m, 0.0, -1.0, 0.0] for x, z in places], np.float32
    )
    range_m = scene.cast(rays).range_m
    met = np.isfinite(range_m)
    assert met.mean() > 0.2
    out_m = MIRROR_OUT_M if SHAPES[name].mirrors else 0.0
    assert np.all(np.abs(range_m[met] - 10) <= body.width_m / 2 + out_m + 1e-4)


@pytest.mark.parametrize("name", VEHICLES)
def test_rays_through_a_windscreen_hit_occupants_and_seats(name: str) -> None:
    """From ahead, a little aside: rays pass the panes and hit the interior."""
    body = BODIES[name]
    scene = Scene(body_mesh(of_its_size(name)))
    targets = np.stack(
        np.meshgrid(np.linspace(-0.4, 0.4, 41) * body.width_m, np.linspace(0.3, 0.95, 60) * body.height_m), -1
    ).reshape(-1, 2)
    eye = np.array([body.length_m / 2 + 12.0, 3.0, min(0.8 * body.height_m, 2.1)])
    ends = np.column_stack([np.full(len(targets), body.length_m / 2 - 1.5), targets])
    direction = (ends - eye) / np.linalg.norm(ends - eye, axis=1, keepdims=True)
    hits = scene.cast(np.column_stack([np.broadcast_to(eye, ends.shape), direction]).astype(np.float32))
    behind = (hits.transmission < 1) & np.isfinite(hits.range_m)
    assert behind.mean() > 0.05
    for material in ("interior", "cloth_dark", "skin"):
        assert np.any(behind & (hits.materials == MATERIAL_ID[material])), material
    assert np.all(hits.transmission[behind] <= 0.25 + 1e-6)


@pytest.mark.parametrize("name", VEHICLES)
def test_rays_hit_plate_and_lamps_from_behind_and_wheels_from_the_side(name: str) -> None:
    body = BODIES[name]
    scene = Scene(body_mesh(of_its_size(name)))
    y, z = np.meshgrid(np.arange(-0.49, 0.5, 0.02) * body.width_m, np.arange(0.2, 0.75 * body.height_m, 0.03))
    rear = np.zeros((y.size, 6), np.float32)
    rear[:, 0], rear[:, 1], rear[:, 2], rear[:, 3] = -20, y.ravel(), z.ravel(), 1
    seen = scene.cast(rear).materials
    assert {MATERIAL_ID["plate"], MATERIAL_ID["lamp"]} <= set(seen.tolist())
    assert 0.005 < RETROREFLECTIVE[seen].mean() < 0.2
    x = np.linspace(-0.5, 0.5, 400) * body.length_m
    side = np.zeros((len(x), 6), np.float32)
    side[:, 0], side[:, 1], side[:, 2], side[:, 4] = x, 10, 0.3, -1
    assert {MATERIAL_ID["rubber"], MATERIAL_ID["rim"]} <= set(scene.cast(side).materials.tolist())


def test_every_body_has_a_shape_and_every_paint_is_a_material() -> None:
    assert set(SHAPES) == set(BODIES)
    assert set(PAINTS) == {name for name in MATERIAL_ID if name.startswith("paint_")}


def test_every_variant_has_a_mesh_and_the_same_seed_the_same() -> None:
    first, again = (body_meshes(draw_variants(np.random.default_rng(1)), {}) for _ in range(2))
    assert len(first) == VARIANTS * len(BODIES)
    for name, mesh in first.items():
        assert np.array_equal(mesh.vertices_m, again[name].vertices_m)
