"""Rays pass panes, hit surfaces behind them, and hit a pane itself only near its normal."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast.materials import (
    CLARITY,
    MATERIAL_ID,
    MATERIALS,
    REFLECTIVITY,
    RETROREFLECTIVE,
    SEMANTIC,
    SEMANTIC_CLASSES,
    TRANSMITTANCE,
)
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.panes import passed_share
from advpipe.stages.simulate.world.raycast.scene import Scene
from advpipe.stages.simulate.world.raycast.shapes import quad


def wall(x_m: float, material: str) -> Mesh:
    """A sheet of 40 m across the x axis."""
    return quad([(x_m, -20, -20), (x_m, 20, -20), (x_m, 20, 20), (x_m, -20, 20)], material)


def ray(degrees: float) -> np.ndarray:
    a = np.deg2rad(degrees)
    return np.array([[0, 0, 0, np.cos(a), np.sin(a), 0]], np.float32)


def passed(degrees: float, *panes: str) -> np.ndarray:
    """What each pane passes at this angle."""
    cos = np.full(len(panes), np.cos(np.deg2rad(degrees)), np.float32)
    return passed_share(np.array([MATERIAL_ID[pane] for pane in panes], np.uint8), cos)


def test_two_panes_attenuate_the_return_of_a_wall() -> None:
    scene = Scene(merge([wall(5, "glass"), wall(6, "glass_tinted"), wall(8, "masonry")]))
    hits = scene.cast(ray(30.0))
    assert hits.range_m[0] == pytest.approx(8 / np.cos(np.deg2rad(30)), abs=1e-4)
    assert hits.materials[0] == MATERIAL_ID["masonry"]
    assert hits.transmission[0] == pytest.approx(np.prod(passed(30.0, "glass", "glass_tinted")), rel=1e-4)
    assert hits.cos_incidence[0] == pytest.approx(np.cos(np.deg2rad(30)), abs=1e-5)


@pytest.mark.parametrize(("degrees", "material"), [(4.0, "glass"), (6.0, "masonry")])
def test_a_pane_returns_rays_only_within_five_degrees_of_its_normal(degrees: float, material: str) -> None:
    hits = Scene(merge([wall(5, "glass"), wall(8, "masonry")])).cast(ray(degrees))
    assert hits.materials[0] == MATERIAL_ID[material]
    assert hits.transmission[0] == pytest.approx(
        1.0 if material == "glass" else passed(6.0, "glass")[0], rel=1e-4
    )


def test_no_return_behind_the_fifth_pane_or_from_the_sky() -> None:
    four = [wall(x, "glass") for x in (2, 3, 4, 5)]
    behind_four = Scene(merge([*four, wall(9, "masonry")])).cast(ray(30.0))
    assert behind_four.transmission[0] == pytest.approx(passed(30.0, "glass")[0] ** 4, rel=1e-3)
    assert np.isinf(Scene(merge([*four, wall(6, "glass"), wall(9, "masonry")])).cast(ray(30.0)).range_m[0])
    assert np.isinf(Scene(merge(four[:2])).cast(ray(30.0)).range_m[0])


def test_an_empty_scene_returns_no_hits() -> None:
    hits = Scene(merge([])).cast(ray(0.0))
    assert np.isinf(hits.range_m[0])
    assert hits.objects[0] == -1


def test_rays_hit_only_their_own_part() -> None:
    mesh = merge([wall(5, "steel"), wall(8, "masonry")])
    scene = Scene(mesh, np.array([0, 0, 1, 1], np.int32))
    rays = np.repeat(ray(0.0), 2, axis=0)
    returns = scene.returns(rays, np.array([0, 1], np.int32))
    assert returns.range_m.tolist() == [
        5.0,
        np.inf,
    ]  # the second wall is hidden: a part has a place of its own


def test_material_tables_agree() -> None:
    assert len(REFLECTIVITY) == len(RETROREFLECTIVE) == len(TRANSMITTANCE) == len(SEMANTIC) == len(MATERIALS)
    assert np.all((REFLECTIVITY > 0) & (REFLECTIVITY <= 1))
    assert {name for name, i in MATERIAL_ID.items() if TRANSMITTANCE[i]} == {"glass", "glass_tinted", "pane"}
    assert np.all(CLARITY >= TRANSMITTANCE)  # heat-absorbing glass passes more visible light than 905 nm
    assert TRANSMITTANCE[MATERIAL_ID["glass_tinted"]] < TRANSMITTANCE[MATERIAL_ID["glass"]] < 0.5**2 + 1e-6
    assert {name for name, i in MATERIAL_ID.items() if RETROREFLECTIVE[i]} == {"sign", "plate", "lamp"}
    assert {SEMANTIC_CLASSES[index] for index in SEMANTIC} == set(SEMANTIC_CLASSES)
