"""Koschmieder's law: contrast falls to 5 % at the meteorological optical range."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.haze import extinction_per_m, veil
from advpipe.pipeline.sensors.lidar.atmosphere import atmosphere_of
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.weather import Weather


def test_contrast_at_the_optical_range_is_5_percent() -> None:
    radiance = np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]], np.float32)
    extinction = extinction_per_m(Weather(kind="fog", visibility_m=80))
    veil(radiance, np.full(2, 80, np.float32), np.zeros(2, np.float32), extinction, np.ones(3, np.float32))
    assert 1 - radiance[0, 0] == pytest.approx(0.05, rel=1e-5)
    assert radiance[0, 1] == pytest.approx(1)


@pytest.mark.parametrize(
    "weather",
    [
        Weather(kind="fog", visibility_m=50),
        Weather(kind="rain", rate_mm_per_h=20),
        Weather(kind="snow", rate_mm_per_h=3),
    ],
)
def test_it_is_the_air_of_the_lidar(weather: Weather) -> None:
    air = atmosphere_of(weather, LidarSensor())
    assert air is not None
    assert extinction_per_m(weather) == pytest.approx(air.extinction_per_m)
