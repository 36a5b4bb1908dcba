"""The scenario's weather and sun as CARLA draws them. CARLA's LiDAR and radar see no weather."""

from __future__ import annotations

import math
from typing import Any

from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.weather import Weather

HEAVIEST_MM_PER_H = 50.0
"""Rain at this rate is drawn as CARLA's heaviest."""

DENSEST_M = 50.0
"""Fog of this visibility is drawn as CARLA's densest."""


def carla_weather(weather: Weather, sun: Float64) -> Any:
    """`carla.WeatherParameters` of a scenario's weather; percentages are CARLA's own, without a unit.

    sun: (3,) unit vector towards it, in the map's axes. Its azimuth is taken to be the yaw towards which its
    light shines, as Unreal turns lights; CARLA's documentation leaves that open.
    """
    import carla

    rain = min(100.0, 100.0 * weather.rate_mm_per_h / HEAVIEST_MM_PER_H) if weather.kind == "rain" else 0.0
    fog = min(100.0, 100.0 * DENSEST_M / weather.visibility_m) if weather.kind == "fog" else 0.0
    if weather.kind == "snow":
        notice("CARLA has no snow: the drive has an overcast sky instead")
    if weather.kind != "clear":
        notice(f"CARLA's LiDAR sees no weather: its clouds are as in clear air, not as in {weather.kind}")
    return carla.WeatherParameters(
        cloudiness={"clear": 10.0, "fog": 60.0}.get(weather.kind, 90.0),
        precipitation=rain,
        precipitation_deposits=rain,
        wetness=rain,
        wind_intensity=10.0,
        sun_azimuth_angle=math.degrees(math.atan2(sun[1], -sun[0])) % 360.0,
        sun_altitude_angle=math.degrees(math.asin(min(1.0, max(-1.0, sun[2])))),
        fog_density=fog,
        fog_distance=0.0,
        fog_falloff=0.1,
    )
