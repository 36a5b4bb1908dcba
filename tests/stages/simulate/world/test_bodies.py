"""Bodies fill their boxes, stand on the ground and are closed to rays from the side."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.stages.simulate.world.bodies import BODIES, VARIANTS, draw_variants
from advpipe.stages.simulate.world.world import Scene


@pytest.mark.parametrize("name", BODIES)
def test_a_body_fills_its_box_exactly(name: str) -> None:
    body = BODIES[name]
    mesh = body.mesh(body.length_m, body.width_m, body.height_m, "paint_red")
    half = np.array([body.length_m / 2, body.width_m / 2])
    assert np.allclose(mesh.vertices_m.min(axis=0), [*-half, 0], atol=1e-9)
    assert np.allclose(mesh.vertices_m.max(axis=0), [*half, body.height_m], atol=1e-9)
    assert body.label in CLASSES


@pytest.mark.parametrize("name", BODIES)
def test_a_ray_from_the_side_hits_the_body_within_its_box(name: str) -> None:
    body = BODIES[name]
    scene = Scene(body.mesh(body.length_m, body.width_m, body.height_m, "paint_red"))
    origin = np.array([0.0, 10.0, 0.6 * body.height_m])
    hits = scene.cast(np.array([[*origin, 0.0, -1.0, 0.0]], np.float32))
    assert 10 - body.width_m / 2 - 1e-4 <= hits.range_m[0] <= 10.0


def test_variants_differ_a_little_and_follow_the_seed() -> None:
    first, again, other = (draw_variants(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert len(first) == VARIANTS * len(BODIES)
    sizes = {name: (v.length_m, v.width_m, v.height_m) for name, v in first.items()}
    assert sizes == {name: (v.length_m, v.width_m, v.height_m) for name, v in again.items()}
    assert sizes != {name: (v.length_m, v.width_m, v.height_m) for name, v in other.items()}
    for variant in first.values():
        assert variant.length_m == pytest.approx(variant.body.length_m, rel=0.075)
