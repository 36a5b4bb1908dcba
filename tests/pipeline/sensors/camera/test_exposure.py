"""Auto-exposure and noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from advpipe.pipeline.sensors.camera.exposure import Exposure
from advpipe.pipeline.sensors.camera.section import CameraSensor


def developed(level: float, seed: int = 0, **keys: float) -> np.ndarray:
    camera = CameraSensor.model_validate({"noise": 0.0, **keys})
    exposure = Exposure(camera, np.random.default_rng(seed))
    return exposure.develop(np.full((3, 60, 80), level, np.float32), np.random.default_rng(seed))


def test_day_and_dusk_are_equally_bright() -> None:
    assert np.ptp([developed(level).mean() for level in (20.0, 2.0, 0.05)]) < 1
    assert developed(2.0, exposure_compensation=1.0).mean() > developed(2.0).mean() + 20


def test_what_is_beside_the_image_circle_does_not_count() -> None:
    radiance = np.full((3, 60, 80), 2.0, np.float32)
    radiance[:, :, 40:] = 0.0
    camera = CameraSensor.model_validate({"noise": 0.0})
    half = Exposure(camera, np.random.default_rng(0)).develop(radiance, np.random.default_rng(0))
    assert np.array_equal(half[:, :40], developed(2.0)[:, :40])
    assert not half[:, 40:].any()


def test_it_follows_the_light_slowly() -> None:
    camera = CameraSensor.model_validate({"noise": 0.0, "exposure_speed": 0.5})
    exposure = Exposure(camera, np.random.default_rng(0))
    levels = [
        exposure.develop(np.full((3, 40, 40), level, np.float32), np.random.default_rng(0)).mean()
        for level in (1.0, 8.0, 8.0, 8.0, 8.0, 8.0)
    ]
    assert levels[1] > levels[0] + 40
    assert all(a > b for a, b in pairwise(levels[1:]))
    assert abs(levels[-1] - levels[0]) < 15


def test_noise_grows_with_gain_and_repeats_with_the_seed() -> None:
    quiet, loud = developed(2.0, noise=1.0), developed(2.0, noise=1.0, iso=1600.0)
    assert 0.3 < quiet.std() < 4
    assert 3 < loud.std() / quiet.std() < 5  # shot noise: the square root of 16
    assert np.array_equal(developed(2.0, noise=1.0), quiet)
    assert not np.array_equal(developed(2.0, seed=1, noise=1.0), quiet)
