"""Daylight: where the sun stands, and the light of the sky.

The sun's place is that of the Astronomical Almanac's low-precision formulas (to 0.01 degrees, 1950 to 2050).
The clear sky is that of Preetham, Shirley and Smits, A practical analytic model for daylight (SIGGRAPH 1999);
the overcast one CIE's standard (Moon and Spencer 1942), brighter overhead than at the horizon.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.weather import Weather

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

TURBIDITY = 2.6

VIVID, BLUER = 0.45, np.array([0.9, 1.0, 1.04])
"""The model's skies are greyer and more violet than those of photographs; what is added to their saturation
under a high sun, and factors on their colours, by eye."""

NIGHT = np.array([0.0021, 0.0017, 0.0013])
"""Luminance of a city's sky and street lamps at night, in kcd/m^2."""

_J2000_S = 946_728_000.0

XYZ_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""To the linear primaries of sRGB (IEC 61966-2-1)."""


def sun_direction(stamp_ns: int, latitude_deg: float, longitude_deg: float) -> Float64:
    """The unit vector (3,) towards the sun: east, north, up; refraction is left out."""
    days = (stamp_ns * 1e-9 - _J2000_S) / 86_400
    anomaly = np.deg2rad(357.528 + 0.9856003 * days)
    ecliptic = np.deg2rad(280.460 + 0.9856474 * days + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly))
    tilt = np.deg2rad(23.439 - 4e-7 * days)
    ascension = np.arctan2(np.cos(tilt) * np.sin(ecliptic), np.cos(ecliptic))
    declination = np.arcsin(np.sin(tilt) * np.sin(ecliptic))
    sidereal = np.deg2rad((280.46062 + 360.98564737 * days + longitude_deg) % 360)
    hour, latitude = sidereal - ascension, np.deg2rad(latitude_deg)
    return np.array(
        [
            -np.cos(declination) * np.sin(hour),
            np.cos(latitude) * np.sin(declination) - np.sin(latitude) * np.cos(declination) * np.cos(hour),
            np.sin(latitude) * np.sin(declination) + np.cos(latitude) * np.cos(declination) * np.cos(hour),
        ]
    )


_PEREZ = np.array(
    [
        [
            [0.1787, -0.3554, -0.0227, 0.1206, -0.0670],
            [-0.0193, -0.0665, -0.0004, -0.0641, -0.0033],
            [-0.0167, -0.0950, -0.0079, -0.0441, -0.0109],
        ],
        [
            [-1.4630, 0.4275, 5.3251, -2.5771, 0.3703],
            [-0.2592, 0.0008, 0.2125, -0.8989, 0.0452],
            [-0.2608, 0.0092, 0.2102, -1.6537, 0.0529],
        ],
    ]
)
"""Slopes and offsets by turbidity of the five coefficients of Perez et al., for Y, x and y."""


@dataclass(frozen=True)
class Daylight:
    """The light at one time in one weather; luminances in kcd/m^2, illuminances in klx.

    sun: (3,) float64, unit vector towards the sun. night: the light of a city's sky at night.
    """

    sun: Float64
    weather: Weather

    @property
    def altitude_rad(self) -> float:
        """The sun's angle above the horizon."""
        return float(np.arcsin(np.clip(self.sun[2], -1, 1)))

    @property
    def is_overcast(self) -> bool:
        return self.weather.kind != "clear"

    @property
    def is_dark(self) -> bool:
        """Whether vehicles drive with their low beams."""
        return bool(self.altitude_rad < np.deg2rad(2.0))

    @cached_property
    def sun_light(self) -> Float64:
        """Illuminance (3,) of a surface that faces the sun, in the primaries of sRGB; 0 below clouds."""
        altitude = self.altitude_rad
        if self.is_overcast or altitude <= 0:
            return np.zeros(3)
        mass = 1 / (np.sin(altitude) + 0.50572 * (np.rad2deg(altitude) + 6.07995) ** -1.6364)
        micrometres = np.array([0.61, 0.55, 0.465])
        rayleigh = 0.008735 * micrometres**-4.08
        aerosol = (0.04608 * TURBIDITY - 0.04586) * micrometres**-1.3
        light: Float64 = 128.0 * np.exp(-mass * (rayleigh + aerosol))
        return light * float(np.clip(altitude / np.deg2rad(1.0), 0, 1))

    def sky(self, directions: Float64) -> Float64:
        """Luminance (N, 3) of the sky without clouds, or of the clouds, towards unit vectors (N, 3)."""
        up = np.maximum(directions[:, 2], 0.0)
        twilight = float(np.clip((np.rad2deg(self.altitude_rad) + 8.0) / 8.0, 0, 1)) ** 3
        night = NIGHT * (0.6 + 1.6 * (1 - up))[:, None]
        if self.is_overcast:
            height = max(float(np.sin(self.altitude_rad)), 0.02)
            zenith = 3 / (7 * np.pi) * 9 * (0.3 + 21 * height) * 0.35
            colour = np.array([0.96, 0.995, 1.05])
            grey = zenith * (1 + 2 * up) / 3 * 1.25
            clouds: Float64 = grey[:, None] * colour * twilight + night
            return clouds
        clear: Float64 = _preetham(directions, self.sun) * twilight + night
        return clear


def _preetham(directions: Float64, sun: Float64) -> Float64:
    altitude = max(float(np.arcsin(np.clip(sun[2], -1, 1))), np.deg2rad(0.8))
    flat = np.hypot(sun[0], sun[1]) or 1.0
    raised = np.array([*(sun[:2] / flat * np.cos(altitude)), np.sin(altitude)])
    zenith_angle = np.pi / 2 - altitude
    cos = np.maximum(directions[:, 2], 0.02)
    gamma = np.arccos(np.clip(directions @ raised, -1, 1))
    t = TURBIDITY
    perez = t * _PEREZ[0] + _PEREZ[1]
    chi = (4 / 9 - t / 120) * (np.pi - 2 * zenith_angle)
    powers = np.array([zenith_angle**3, zenith_angle**2, zenith_angle, 1.0])
    squares = np.array([t * t, t, 1.0])
    x_matrix = np.array(
        [
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]
    )
    y_matrix = np.array(
        [
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]
    )
    zenith = np.array(
        [
            (4.0453 * t - 4.9710) * np.tan(chi) - 0.2155 * t + 2.4192,
            squares @ x_matrix @ powers,
            squares @ y_matrix @ powers,
        ]
    )

    def distribution(c: Float64, cos_view: Float64 | float, angle: Float64 | float) -> Float64:
        value: Float64 = (1 + c[0] * np.exp(c[1] / cos_view)) * (
            1 + c[2] * np.exp(c[3] * angle) + c[4] * np.cos(angle) ** 2
        )
        return value

    luminance, x, y = (
        zenith[i] * distribution(perez[i], cos, gamma) / distribution(perez[i], 1.0, zenith_angle)
        for i in range(3)
    )
    luminance = np.maximum(luminance, 0.02)
    y = np.maximum(y, 0.05)
    xyz = np.column_stack([luminance * x / y, luminance, luminance * (1 - x - y) / y])
    rgb = np.maximum(xyz @ XYZ_TO_RGB.T, 0.0)
    grey = rgb @ [0.2126, 0.7152, 0.0722]
    vividness = 1 + VIVID * float(np.clip(altitude / np.deg2rad(25.0), 0, 1))
    vivid: Float64 = np.maximum(grey[:, None] + vividness * (rgb - grey[:, None]), 0.0) * BLUER
    return vivid
