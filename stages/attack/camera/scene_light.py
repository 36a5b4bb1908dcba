"""The light of a recorded drive: that of its scenario's sun, sky and weather, in the exposure of an image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from pydantic import Field

from advpipe.pipeline.bag.latched import read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Count, Document
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.pipeline.sensors.camera.daylight import Daylight, sun_direction
from advpipe.pipeline.sensors.camera.haze import extinction_per_m
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.pipeline.sensors.weather import Weather

Float64 = npt.NDArray[np.float64]

SKY_S = 60
"""How long one sky serves, as in cameras."""

DARKEST = 5e-4
"""Signals up to it are black."""

MIDDLE_GREY = 0.18
"""Mean reflectance of scenes, where nothing of known reflectance is in view."""


class _Map(Document):
    origin: GeoOrigin = Field(default_factory=GeoOrigin)


class _Environment(Document):
    weather: Weather = Field(default_factory=Weather)


class _Simulation(Document):
    seed: Count = 1


class _LightInfo(Document):
    simulation: _Simulation = Field(default_factory=_Simulation)
    map: _Map = Field(default_factory=_Map)
    environment: _Environment = Field(default_factory=_Environment)


@dataclass(frozen=True)
class Illumination:
    """The light at one time.

    is_dark: whether lamps outshine it. is_wet: whether roads are. ambient: (4, 3), as in `SkyMap`. sun: (3,)
    unit vector towards the sun in the map frame; sun_light: (3,) illuminance in klx of a surface that faces
    it. horizon: (3,) luminance of the air in kcd/m^2. extinction_per_m: of that air.
    """

    is_dark: bool
    is_wet: bool
    ambient: Float64
    sun: Float64
    sun_light: Float64
    horizon: Float64
    extinction_per_m: float

    def white(self, normal: Float64, is_sunny: bool) -> Float64:
        """Luminance (3,) in kcd/m^2 of a white matt surface with this normal (3,) in the map frame."""
        light = self.ambient[0] + self.ambient[1:].T @ normal
        if is_sunny:
            light = light + self.sun_light * max(float(self.sun @ normal), 0.0) / np.pi
        clipped: Float64 = np.maximum(light, 1e-6)
        return clipped

    def transmittance(self, range_m: Float64) -> Float64:
        """Share of the light that passes the air over these ranges."""
        passed: Float64 = np.exp(-self.extinction_per_m * range_m)
        return passed

    def usual_exposure(self, signal: npt.NDArray[np.float32]) -> float:
        """The exposure in 1/(kcd/m^2) of a signal (H, W, 3), if its scene is as bright as scenes are."""
        white = float(self.white(np.array([0.0, 0.0, 1.0]), True)[1])
        return float(np.exp(log_mean(signal))) / (MIDDLE_GREY * white)


def log_mean(signal: npt.NDArray[np.float32]) -> float:
    """Of a signal (H, W, 3), as auto-exposure measures it: without what is black, as beside a fisheye's image
    circle."""
    rows = signal[signal.shape[0] // 6 :: 4, ::4, 1]
    seen = rows[rows > DARKEST]
    return float(np.log(seen).mean()) if len(seen) else float(np.log(DARKEST))


class SceneLight:
    """The light of a drive; of another tool's drive, that of the default scenario's place in clear air."""

    def __init__(self, reader: BagReader) -> None:
        info = _LightInfo()
        if SCENARIO_INFO.name in reader.topics:
            info = read_scenario_info(reader, _LightInfo)
        self._origin, self._weather = info.map.origin, info.environment.weather
        self._seed = info.simulation.seed

    def at(self, stamp_ns: int) -> Illumination:
        """The light at a time."""
        place = self._origin.latitude_deg, self._origin.longitude_deg
        return _illumination(stamp_ns // (SKY_S * 1_000_000_000), self._weather, *place, self._seed)


@lru_cache(maxsize=4)
def _illumination(
    slot: int, weather: Weather, latitude_deg: float, longitude_deg: float, seed: int
) -> Illumination:
    sun = sun_direction(slot * SKY_S * 1_000_000_000, latitude_deg, longitude_deg)
    daylight = Daylight(sun, weather)
    sky = SkyMap(daylight, named_generator(seed, "sky"))
    return Illumination(
        daylight.is_dark,
        weather.kind in ("rain", "snow"),
        sky.ambient.astype(np.float64),
        sun,
        daylight.sun_light,
        sky.horizon.astype(np.float64),
        extinction_per_m(weather),
    )
