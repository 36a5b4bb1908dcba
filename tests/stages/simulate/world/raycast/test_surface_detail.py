"""Texture, relief and gloss of surfaces: fixed to places, of the given size, and different by material."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.shapes import quad
from advpipe.stages.simulate.world.raycast.surface_detail import (
    PAINT_GLOSS,
    ROUGHNESS,
    TRIM_GLOSS,
    DetailMap,
)

MAP = DetailMap(np.array([3.0, 8.0]))
COUNT = 100_000


def seen(material: str, fixed: bool = True, from_m: float = 30.0, details: DetailMap = MAP):  # type: ignore[no-untyped-def]
    """Places of a square of 20 m, seen vertically from above."""
    places = np.random.default_rng(0).uniform(-10, 10, (COUNT, 2))
    rays = np.zeros((COUNT, 6), np.float32)
    rays[:, :2], rays[:, 2], rays[:, 5] = places, from_m, -1
    materials = np.full(COUNT, MATERIAL_ID[material], np.uint8)
    return details.at(rays, np.full(COUNT, from_m, np.float32), materials, np.full(COUNT, fixed))


@pytest.mark.parametrize("material", ["asphalt", "grass", "plaster"])
def test_relief_and_contrast_have_the_size_of_the_table(material: str) -> None:
    kind = {"asphalt": "road", "grass": "ground", "plaster": "building"}[material]
    detail, rough = seen(material), ROUGHNESS[kind]
    assert detail.relief_m.std() == pytest.approx(rough.relief_m, rel=0.05)
    assert abs(detail.relief_m.mean()) < 0.1 * rough.relief_m
    assert detail.texture.mean() == pytest.approx(1, abs=0.35)  # stains may be larger than 20 m
    assert 0.3 * rough.contrast < detail.texture.std() < 2 * rough.contrast
    assert detail.texture.min() >= 0.1
    assert not detail.gloss.any()


def test_a_place_is_the_same_from_everywhere_and_another_seed_has_another_map() -> None:
    low, high = seen("asphalt", from_m=2.0), seen("asphalt", from_m=40.0)
    assert np.mean(np.isclose(low.texture, high.texture)) > 0.99
    other = seen("asphalt", details=DetailMap(np.array([20.0, 1.0])))
    assert np.corrcoef(low.relief_m, other.relief_m)[0, 1] < 0.05


def test_bodies_have_gloss_and_no_pattern() -> None:
    detail = seen("paint_grey", fixed=False)
    assert (detail.texture == 1).all()
    assert not detail.relief_m.any()
    assert detail.gloss == pytest.approx(PAINT_GLOSS)
    assert 0 < TRIM_GLOSS < PAINT_GLOSS < 1
    assert seen("rim", fixed=False).gloss == pytest.approx(TRIM_GLOSS)
    assert not seen("interior", fixed=False).gloss.any()


def test_hits_find_the_detail_of_their_materials() -> None:
    wall = quad([(5, -20, -20), (5, 20, -20), (5, 20, 20), (5, -20, 20)], "masonry")
    angles = np.linspace(-1, 1, 500)
    rays = np.zeros((500, 6), np.float32)
    rays[:, 3], rays[:, 4] = np.cos(angles), np.sin(angles)
    hits = Scene(wall).cast(rays)
    assert hits.detail() is None  # a scene alone has no place in a map
    detail = replace(hits, origins=(rays, MAP)).detail()
    assert detail is not None
    assert detail.relief_m.std() == pytest.approx(ROUGHNESS["building"].relief_m, rel=0.2)
