"""Cameras see gaps between leaves; LiDARs and the sun's shadows do not."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from advpipe.stages.simulate.world.raycast.leaf_gaps import SHAPES, SIZE, leaf_tile
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge, surface
from advpipe.stages.simulate.world.raycast.scene import MAX_GAPS, Scene

SIDE_M = 4.0


def sheet(x_m: float, material: str) -> Mesh:
    """A large triangle across the x axis."""
    corners = np.array([[x_m, -SIDE_M, -SIDE_M], [x_m, SIDE_M, -SIDE_M], [x_m, 0, SIDE_M]])
    return surface(corners, np.arange(3).reshape(1, 3), material)


def rays_ahead(count: int = 20_000) -> npt.NDArray[np.float32]:
    """Parallel rays that meet every sheet."""
    rays = np.zeros((count, 6), np.float32)
    rays[:, 1:3] = np.random.default_rng(0).uniform(-1, 1, (count, 2))
    rays[:, 3] = 1
    return rays


@pytest.mark.parametrize("material", SHAPES)
def test_the_share_of_light_that_passes_is_that_of_the_gaps(material: str) -> None:
    sight = Scene(merge([sheet(5, material), sheet(9, "masonry")])).sight(rays_ahead())
    passed = np.isclose(sight.range_m, 9, atol=1e-4)
    assert np.isclose(sight.range_m[~passed], 5).all()
    assert passed.mean() == pytest.approx(1 - SHAPES[material].cover, abs=0.06)
    assert (sight.triangles[passed] == 1).all()


def test_gaps_are_as_large_as_leaves() -> None:
    """A row of rays 1 cm apart changes between leaf and gap a few times a metre, not at every ray."""
    rays = np.zeros((200, 6), np.float32)
    rays[:, 1], rays[:, 3] = np.linspace(-1, 1, 200), 1
    sight = Scene(merge([sheet(5, "foliage"), sheet(9, "masonry")])).sight(rays)
    assert 8 <= np.count_nonzero(np.diff(sight.range_m > 7)) <= 60


def test_light_passes_a_few_gaps_only() -> None:
    sheets = [sheet(5 + number, "foliage") for number in range(MAX_GAPS + 2)]
    sight = Scene(merge(sheets)).sight(rays_ahead())
    shares = np.bincount(np.round(sight.range_m - 5).astype(int), minlength=len(sheets)) / len(sight.range_m)
    gap = 1 - SHAPES["foliage"].cover
    assert shares[:MAX_GAPS] == pytest.approx([(1 - gap) * gap**n for n in range(MAX_GAPS)], abs=0.06)
    assert shares[MAX_GAPS] == pytest.approx(gap**MAX_GAPS, abs=0.06)
    assert shares[MAX_GAPS + 1 :].sum() == 0


def test_lidars_and_shadows_meet_the_whole_triangle() -> None:
    scene = Scene(merge([sheet(5, "foliage"), sheet(9, "masonry")]))
    assert np.isclose(scene.cast(rays_ahead()).range_m, 5).all()
    assert scene.is_occluded(rays_ahead()).all()


def test_other_materials_have_no_gaps() -> None:
    for material in ("masonry", "bark", "tall_grass"):
        assert material in MATERIAL_ID
        sight = Scene(merge([sheet(5, material), sheet(9, "masonry")])).sight(rays_ahead(2000))
        assert np.isclose(sight.range_m, 5).all()


def test_panes_are_seen_through_gaps() -> None:
    scene = Scene(merge([sheet(5, "foliage"), sheet(7, "glass"), sheet(9, "masonry")]))
    sight = scene.sight(rays_ahead())
    behind = np.flatnonzero(sight.range_m > 8)
    assert set(sight.panes.rays) == set(behind)
    assert np.allclose(sight.panes.range_m, 7, atol=1e-4)


@pytest.mark.parametrize("material", SHAPES)
def test_the_tile_is_periodic(material: str) -> None:
    tile = leaf_tile(SHAPES[material]).reshape(SIZE, SIZE)
    inside = np.mean(tile[:, 1:] != tile[:, :-1])
    assert np.mean(tile[:, 0] != tile[:, -1]) < 2 * inside
    assert np.mean(tile[0] != tile[-1]) < 2 * inside
