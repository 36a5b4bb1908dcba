"""Panes: their nominal transmittance at normal incidence, less aslant, by Fresnel and Beer-Lambert."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID, TRANSMITTANCE
from advpipe.stages.simulate.world.raycast.panes import passed_share

GLASS, PANE = MATERIAL_ID["glass"], MATERIAL_ID["pane"]


def share(material: int, degrees: list[float]) -> np.ndarray:
    cos = np.cos(np.deg2rad(degrees)).astype(np.float32)
    return passed_share(np.full(len(degrees), material, np.uint8), cos)


def test_at_normal_incidence_panes_pass_their_transmittance() -> None:
    for material in (GLASS, PANE, MATERIAL_ID["glass_tinted"]):
        assert share(material, [0.0])[0] == pytest.approx(TRANSMITTANCE[material], rel=1e-5)


def test_light_fades_with_the_angle_and_none_passes_along_the_pane() -> None:
    passed = share(GLASS, [0, 20, 40, 60, 70, 80, 90])
    assert np.all(np.diff(passed) < 0)
    assert passed[-1] < 1e-3 * passed[0]


def test_clear_glass_at_brewsters_angle_follows_fresnel() -> None:
    """There, the parallel half passes whole; the other loses ((n^2 - 1) / (n^2 + 1))^2 at each face."""
    index = 1.52
    brewster = np.rad2deg(np.arctan(index))
    lost = ((index**2 - 1) / (index**2 + 1)) ** 2 / 2
    normal = ((index - 1) / (index + 1)) ** 2
    inside = 1 / np.sin(np.deg2rad(brewster))  # the refracted ray is at right angles to the mirrored one
    absorbed = TRANSMITTANCE[PANE] / (1 - normal) ** 4
    assert share(PANE, [brewster])[0] == pytest.approx((1 - lost) ** 4 * absorbed**inside, rel=1e-4)


def test_a_windscreen_passes_half_of_what_it_would_upright() -> None:
    assert share(GLASS, [65.0])[0] / share(GLASS, [0.0])[0] == pytest.approx(0.5, abs=0.06)
