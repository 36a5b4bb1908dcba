"""The light on a patch follows from the road, the sun and the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from camera_scenes import scene

from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.stages.attack.camera.patch_light import BODY, ROAD, PatchLight, patch_light
from advpipe.stages.attack.camera.patch_place import PatchSize, VehicleRear
from advpipe.stages.attack.camera.scene import CameraScene
from advpipe.stages.attack.camera.scene_light import Illumination

EXPOSURE = 0.1
SKY, SUN = 4.0, 80.0
"""A uniform sky of 4 kcd/m^2, and the sun straight behind the camera, 45 degrees up."""


def light(**keys: object) -> Illumination:
    ambient = np.zeros((4, 3))
    ambient[0] = SKY
    behind = np.array([-1.0, 0.0, 1.0]) / np.sqrt(2)
    known = Illumination(False, False, ambient, behind, np.full(3, SUN), np.full(3, 5.0), 0.0)
    return replace(known, **keys)  # type: ignore[arg-type]


def on_a_road() -> CameraScene:
    """The lower half that is not the vehicle's is road, some metres ahead."""
    clean = scene()
    rows = np.arange(480)[:, None] * np.ones(640)
    road = (clean.users < 0) & (rows > 260)
    away_m = np.where(road, 1.5 * 400 / np.maximum(rows - 239.5, 1), clean.range_m)
    return replace(clean, range_m=away_m, tags=np.where(road, TAG["Roads"], clean.tags).astype(np.uint8))


def lit(around: Illumination, road_kcd: npt.ArrayLike, body: float = 0.2) -> PatchLight:
    known = on_a_road()
    signal = np.full((480, 640, 3), 0.2, np.float32)
    signal[known.tags == TAG["Roads"]] = (np.asarray(road_kcd) * EXPOSURE)[..., None]
    signal[known.pixels_of("van")] = body
    pose = VehicleRear("van", PatchSize(1.0, 0.5), 1.0).optical_SE3_patch(known)
    assert pose is not None
    pixels = np.flatnonzero(known.pixels_of("van"))
    return patch_light(known, signal, around, known.pixels_of("van"), pose, pixels)


def test_in_the_sun() -> None:
    """The sun is as steep on the rear as on the road: white has what the road has, over its reflectance."""
    white_kcd = SKY + SUN / np.sqrt(2) / np.pi
    found = lit(light(), ROAD * white_kcd)
    assert found.white == pytest.approx(np.full(3, EXPOSURE * white_kcd), rel=0.01)
    assert found.air == pytest.approx(np.zeros(3))


def test_in_the_shade() -> None:
    found = lit(light(sun_light=np.zeros(3)), ROAD * SKY)
    assert found.white == pytest.approx(np.full(3, EXPOSURE * SKY), rel=0.01)


def test_the_rear_of_one_that_drives_into_the_sun_is_in_its_own_shade() -> None:
    ahead = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    white_kcd = SKY + SUN / np.sqrt(2) / np.pi
    found = lit(light(sun=ahead), ROAD * white_kcd)
    assert found.white == pytest.approx(np.full(3, EXPOSURE * SKY), rel=0.01)


def test_air_takes_contrast() -> None:
    """Koschmieder over 9.99 m at 0.05 / m: 39 % is lost, and the air's light comes for it."""
    known = on_a_road()
    road_m = known.range_m[known.tags == TAG["Roads"]]
    veiled = np.exp(-0.05 * road_m)
    found = lit(light(sun_light=np.zeros(3), extinction_per_m=0.05), ROAD * SKY * veiled + 5.0 * (1 - veiled))
    passed = np.exp(-0.05 * np.hypot(9.99, 0.5))
    assert found.white == pytest.approx(np.full(3, EXPOSURE * SKY * passed), rel=0.01)
    assert found.air == pytest.approx(np.full(3, EXPOSURE * 5.0 * (1 - passed)), rel=0.01)


def test_in_the_dark_the_body_tells() -> None:
    white = lit(light(is_dark=True), 1.0, body=0.06).white
    assert white == pytest.approx(np.full((len(white), 3), 0.06 / BODY))
