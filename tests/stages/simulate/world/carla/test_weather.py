"""The scenario's weather and sun in CARLA's terms."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.weather import Weather
from advpipe.stages.simulate.world.carla.weather import carla_weather

pytest.importorskip("carla")
pytestmark = pytest.mark.oracle


@pytest.mark.parametrize(
    ("sun", "altitude_deg", "azimuth_deg"),
    [((1.0, 0, 0), 0, 180), ((0, 1.0, 0), 0, 90), ((-0.6, 0, 0.8), 53.13, 0), ((0, -0.6, -0.8), -53.13, 270)],
)
def test_light_shines_away_from_the_sun(
    sun: tuple[float, float, float], altitude_deg: float, azimuth_deg: float
) -> None:
    """CARLA's yaw is clockwise from the east: light from the north shines to the south, at 90 degrees."""
    found = carla_weather(Weather(), np.array(sun))
    assert found.sun_altitude_angle == pytest.approx(altitude_deg, abs=0.01)
    assert found.sun_azimuth_angle == pytest.approx(azimuth_deg, abs=0.01)


def test_rain_fog_and_snow(capsys: pytest.CaptureFixture[str]) -> None:
    up = np.array([0.0, 0.0, 1.0])
    assert carla_weather(Weather(kind="rain", rate_mm_per_h=25), up).precipitation == 50
    assert carla_weather(Weather(kind="fog", visibility_m=100), up).fog_density == 50
    capsys.readouterr()
    assert carla_weather(Weather(kind="snow", rate_mm_per_h=2), up).precipitation == 0
    said = capsys.readouterr().err
    assert "CARLA has no snow" in said
    assert "CARLA's LiDAR sees no weather" in said
