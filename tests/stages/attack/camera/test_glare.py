"""Glare: the light at the lens, its spread, and its picture, by numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from camera_scenes import fisheye, pinhole

from advpipe.stages.attack.camera.glare import Glare, Light, spread_per_sr

LIGHT = Light(azimuth_deg=10, elevation_deg=5, distance_m=20, power_w=2, divergence_mrad=5, source_m=0.1)


def test_the_light_is_that_of_its_beam() -> None:
    """600 lm on a disc of 0.1 m + 0.005 * 20 m = 0.2 m: 19.1 klx."""
    assert LIGHT.illuminance_klx == pytest.approx(600 / (np.pi / 4 * 0.04) / 1000)
    assert LIGHT.radius_deg == pytest.approx(np.rad2deg(0.05 / 20), rel=1e-3)


def test_a_point_of_light_spreads_and_loses_nothing() -> None:
    """The spread is normalised over the sphere (Spencer et al.: the sum of its parts is 1)."""
    edges = np.concatenate([np.linspace(0, 0.2, 4001), np.geomspace(0.2, 180, 20001)[1:]])
    middle, ring = (edges[1:] + edges[:-1]) / 2, -np.diff(np.cos(np.deg2rad(edges))) * 2 * np.pi
    assert (spread_per_sr(middle) * ring).sum() == pytest.approx(1, abs=0.12)
    assert spread_per_sr(np.array([1.0]))[0] == pytest.approx(10 / 1.02**3 + 10 / 1.02**2, rel=0.01)


@pytest.mark.parametrize("lens", [pinhole(), fisheye()])
def test_it_is_brightest_where_it_stands(lens: object) -> None:
    picture = Glare(lens, LIGHT, 0, 0.3).luminance(1.0)[..., 1]  # type: ignore[arg-type]
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    expected = lens.project(LIGHT.direction[None])[0]  # type: ignore[attr-defined]
    assert (column, row) == pytest.approx(expected, abs=1)
    assert expected[0] < 319.5
    assert expected[1] < 239.5  # left and up of the middle


def test_the_disc_holds_the_light() -> None:
    """Its luminance times its solid angle is the illuminance."""
    lens = pinhole(4000.0)
    near = Light(0, 0, 10, 1, 5, 0.2)  # 1.15 degrees across: 80 pixels
    picture = Glare(lens, near, 0, 0.0).luminance(2.0)[..., 1] / 0.98
    assert picture.sum() / 4000**2 == pytest.approx(2.0, rel=0.03)


def test_stray_light_fades_with_the_angle() -> None:
    """6.5 and 69.5 pixels beside the axis, from the edge of the light on."""
    light = Light(0, 0, 20, 1, 5, 0.05)
    picture = Glare(pinhole(), light, 0, 0.3).luminance(1.0)[240, :, 1]
    angles_deg = np.rad2deg(np.arctan(np.array([np.hypot(6.5, 0.5), 69.5]) / 400)) - light.radius_deg
    expected = 0.3 * spread_per_sr(angles_deg) * 0.98
    assert picture[[326, 389]] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("blades", "arms"), [(0, 0), (6, 6), (5, 10)])
def test_streaks_are_as_many_as_the_blades_make(blades: int, arms: int) -> None:
    """An even number of blades makes as many streaks, an odd one twice as many."""
    lens = pinhole()
    plain, streaked = (
        Glare(lens, Light(0, 0, 20, 1, 5, 0.05), n, 0.3).luminance(1.0)[..., 1] for n in (0, blades)
    )
    added = streaked - plain
    turns = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    ring = added[
        np.rint(239.5 + 60 * np.sin(turns)).astype(int), np.rint(319.5 + 60 * np.cos(turns)).astype(int)
    ]
    is_bright = ring > 0.3 * max(float(ring.max()), 1e-12)
    assert int((is_bright & ~np.roll(is_bright, 1)).sum()) == arms
