"""The air between a camera and the world: Koschmieder's law in fog, rain and snow.

L = L0 exp(-b d) + A (1 - exp(-b d)): the contrast of a surface falls with its distance d (Koschmieder 1924).
The extinction coefficient b is that of the LiDAR's air, ln 20 over the meteorological optical range in fog.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.atmosphere import rain_extinction_per_m, snow_extinction_per_m
from advpipe.pipeline.sensors.weather import Weather

Float32 = npt.NDArray[np.float32]

LAYER_M = 120.0
"""Height of the layer of fog, rain or snow, through which the sky is seen."""


def extinction_per_m(weather: Weather) -> float:
    """The extinction coefficient of visible light."""
    if weather.kind == "rain":
        return rain_extinction_per_m(weather.rate_mm_per_h)
    if weather.kind == "snow":
        return snow_extinction_per_m(weather.rate_mm_per_h)
    return float(np.log(20) / weather.visibility_m)


def veil(radiance: Float32, range_m: Float32, up: Float32, extinction: float, airlight: Float32) -> None:
    """Attenuate the radiance (3, N) of rays in place, and add that of the air between.

    range_m: (N,), infinite for the sky. up: (N,) vertical component of the rays' directions.
    """
    path_m = np.minimum(range_m, np.float32(LAYER_M) / np.maximum(up, np.float32(1e-3)))
    passed = np.exp(path_m * np.float32(-extinction))
    radiance -= airlight[:, None]
    radiance *= passed
    radiance += airlight[:, None]
