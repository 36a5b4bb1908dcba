"""Pictures of the boulevard by rigs of small cameras."""

from __future__ import annotations

from datetime import datetime, timezone

import numpy as np
import pytest

from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.sensors.camera.rig import CameraRig, CameraView
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant
from advpipe.pipeline.sensors.weather import Weather
from advpipe.stages.simulate.traffic.road_users import RoadUser

NOON_NS = int(datetime(2026, 6, 21, 10, tzinfo=timezone.utc).timestamp()) * 10**9
SIZE = {"image_size_x": 96, "image_size_y": 64, "noise": 0.0}


def look(place, weather: Weather | None = None, speed_mps: float = 0.0, **keys: object) -> CameraView:
    """What one camera sees from the middle of the first lane."""
    lane = place.network.drivable[0].lanes[0].centre_m
    middle = lane[len(lane) // 2]
    ahead = (lane[-1] - lane[0]) / np.linalg.norm(lane[-1] - lane[0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = ahead, np.cross([0, 0, 1], ahead)
    pose[:3, 3] = middle
    ego = RoadUser("ego", place.variants["sedan.0"], pose, speed_mps * ahead)
    other = np.copy(pose)
    other[:3, 3] += 9 * ahead
    users = [ego, RoadUser("other", place.variants["hatchback.1"], other, np.zeros(3))]
    drive = DriveSettings(1, 0.1, weather or Weather(), False, 49.0, 8.0)
    rig = CameraRig("ego", {"front": CameraSensor.model_validate(SIZE | keys)}, drive)
    motion = MotionStep(pose, speed_mps * ahead, np.zeros(3), np.zeros(3))
    views, _ = rig.look(Instant(0, NOON_NS, motion, place.world.around(ego, users)))
    return views["front"]


@pytest.fixture(scope="module")
def clear(boulevard) -> CameraView:
    return look(boulevard)


def test_motion_blurs_only_where_it_is_asked_for(boulevard, clear: CameraView) -> None:
    blurred = {"motion_blur_intensity": 1.0, "shutter_speed": 10.0}
    still = clear.rgb
    assert np.array_equal(look(boulevard, speed_mps=20.0).rgb, still)
    assert np.array_equal(look(boulevard, **blurred).rgb, still)
    moving = look(boulevard, speed_mps=20.0, **blurred).rgb
    assert np.abs(moving.astype(int) - still).max() > 30


def test_four_samples_keep_what_one_shows(boulevard, clear: CameraView) -> None:
    one, four = clear, look(boulevard, samples=4)
    assert np.array_equal(one.layers.tags, four.layers.tags)
    difference = np.abs(one.rgb.astype(int) - four.rgb)
    assert 0 < difference.mean() < 4


def test_a_distorted_lens_and_a_fisheye_see_the_car_ahead(boulevard) -> None:
    for keys in ({"distortion": (-0.1, 0.01)}, {"projection": "fisheye", "fov": 200.0}):
        view = look(boulevard, **keys)
        (car,) = (each for each in view.objects if each.id == "other")
        assert car.class_name == "car"
        assert car.truncation == 0
        assert car.visible_share > 0.95
        left, top, right, bottom = car.amodal_px
        assert left <= 48 <= right
        assert top <= 40 <= bottom + 8


def test_fog_lowers_contrast_and_snow_is_drawn(boulevard, clear: CameraView) -> None:
    fog = look(boulevard, Weather(kind="fog", visibility_m=30)).rgb
    assert fog.std() < 0.6 * clear.rgb.std()
    snow = look(boulevard, Weather(kind="snow", rate_mm_per_h=3)).rgb
    assert (np.abs(np.diff(snow[:24].astype(int), axis=1)).max(axis=2) > 8).sum() > 3  # flakes before the sky


def test_bands_do_not_change_a_picture(boulevard, clear: CameraView, monkeypatch) -> None:
    """Pictures with more rays than are cast at once are the same."""
    from advpipe.pipeline.sensors.camera import picture

    monkeypatch.setattr(picture, "MAX_RAYS", 1000)
    banded = look(boulevard)
    assert np.array_equal(clear.layers.objects, banded.layers.objects)
    assert np.abs(clear.rgb.astype(int) - banded.rgb).max() <= 2
