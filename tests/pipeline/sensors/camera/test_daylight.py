"""The sun's place against an almanac's, and the sky's light."""

from __future__ import annotations

from datetime import datetime, timezone

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.daylight import Daylight, sun_direction
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.pipeline.sensors.weather import Weather


def sun(when: str, latitude_deg: float, longitude_deg: float) -> np.ndarray:
    moment = datetime.fromisoformat(when).replace(tzinfo=timezone.utc)
    return sun_direction(int(moment.timestamp()) * 10**9, latitude_deg, longitude_deg)


@pytest.mark.parametrize(
    ("when", "latitude_deg", "longitude_deg", "altitude_deg", "azimuth_deg"),
    [
        # At the solstice the sun is 90 - latitude + 23.44 degrees high at noon, and in the south; at an
        # equinox it rises in the east. Solar noon follows from the equation of time (-1.9, -7.4 minutes).
        ("2026-06-21T12:01:54", 49.0, 0.0, 64.44, 180.0),
        ("2026-12-21T11:58:10", 49.0, 0.0, 17.56, 180.0),
        ("2026-03-20T12:07:24", 0.0, 0.0, 90.0, None),
        ("2026-03-20T06:07:24", 0.0, 0.0, 0.0, 90.0),
        # Meeus, Astronomical Algorithms, example 25.a: declination -7.785 degrees on 1992 October 13.0 TD.
        ("1992-10-13T00:00:00", 90.0, 0.0, -7.785, None),
    ],
)
def test_the_sun_stands_where_almanacs_say(
    when: str, latitude_deg: float, longitude_deg: float, altitude_deg: float, azimuth_deg: float | None
) -> None:
    east, north, up = sun(when, latitude_deg, longitude_deg)
    assert np.rad2deg(np.arcsin(up)) == pytest.approx(altitude_deg, abs=0.15)
    if azimuth_deg is not None:
        assert np.rad2deg(np.arctan2(east, north)) % 360 == pytest.approx(azimuth_deg, abs=0.8)


def test_a_clear_noon_is_as_bright_as_photometers_measure_it() -> None:
    """In full sun, level ground gets 80 to 130 klx; 10 to 50 klx from the blue sky and its clouds."""
    daylight = Daylight(sun("2026-06-21T12:00:00", 45.0, 0.0), Weather())
    sky = SkyMap(daylight, np.random.default_rng(0))
    weight = np.array([0.2126, 0.7152, 0.0722])
    of_sun = daylight.sun_light @ weight * daylight.sun[2]
    of_sky = np.pi * ((sky.ambient[0] + sky.ambient[3]) @ weight)
    assert 70 < of_sun < 110
    assert 10 < of_sky < 50
    zenith = daylight.sky(np.array([[0.0, -0.5, 0.87]]))[0]
    assert zenith[2] > 1.3 * zenith[0]  # blue


def test_clouds_hide_the_sun_and_night_is_dark() -> None:
    high = sun("2026-06-21T12:00:00", 45.0, 0.0)
    overcast = Daylight(high, Weather(kind="rain", rate_mm_per_h=5))
    assert not overcast.sun_light.any()
    night = Daylight(sun("2026-06-21T23:59:00", 45.0, 0.0), Weather())
    assert night.is_dark
    assert not night.sun_light.any()
    up = np.array([[0.0, 0.0, 1.0]])
    assert night.sky(up).max() < 0.01 * overcast.sky(up).min()
