"""The way to a target and back: radar equation, antenna, reflection by the road, rain."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.radar.detection import STATED_PROBABILITY, needed_snr
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.weather import Weather

Float64 = npt.NDArray[np.float64]

STATED_RCS_M2 = 10.0
"""RCS of the target for which a section states the range: that of the rear of a passenger car."""

LIGHT_MPS = 299_792_458.0

ROAD_ROUGHNESS_M = 0.3e-3
"""Standard deviation of the height of asphalt at the scale of the wavelength."""


class Propagation:
    """The powers that one radar receives, in units of its noise."""

    def __init__(self, section: RadarSensor, weather: Weather) -> None:
        probability, cells = section.false_alarm_probability, section.cfar_cells
        snr = needed_snr(STATED_PROBABILITY, probability, cells)
        self._constant = snr * section.detection_range_m**4 / STATED_RCS_M2
        self._half_rad = np.deg2rad(section.horizontal_fov) / 2, np.deg2rad(section.vertical_fov) / 2
        self._wavelength_m = LIGHT_MPS / (section.frequency_ghz * 1e9)
        self._ground_reflection, self._height_m = section.ground_reflection, section.z_m
        self._rain_nepers_per_m = rain_db_per_km(weather) * math.log(10) / 10 / 1000

    def snr_of_1m2(self, range_m: Float64, azimuth_rad: Float64, elevation_rad: Float64) -> Float64:
        """The radar equation (N,): SNR of a target of 1 m² in free space, with the antenna's gain and rain.

        SNR = P G² lambda² sigma / ((4 pi)³ R⁴ N); the constants are those with which the target of the stated
        range is detected as stated.
        """
        gain = self.antenna_gain(azimuth_rad, elevation_rad)
        rain = np.exp(-2 * self._rain_nepers_per_m * range_m)
        return np.asarray(self._constant * gain * gain * rain / np.maximum(range_m, 0.1) ** 4)

    def antenna_gain(self, azimuth_rad: Float64, elevation_rad: Float64) -> Float64:
        """One-way gain (N,) relative to the axis: Gaussian, -3 dB at each edge of the field of view."""
        offset = (azimuth_rad / self._half_rad[0]) ** 2 + (elevation_rad / self._half_rad[1]) ** 2
        return np.asarray(np.exp(-math.log(2) * offset))

    def ground_factor(self, range_m: Float64, target_height_m: Float64) -> Float64:
        """Factor (N,) on the power by the wave that the road reflects: |1 + rho exp(i phi)|⁴.

        phi = 2 pi / lambda times the difference of both ways, 2 h h' / R; rho is negative at grazing
        incidence, and smaller on a rough road: exp(-2 (2 pi s sin(psi) / lambda)²) (Ament 1953; Barton, Radar
        Equations for Modern Radar, 2013, section 8).
        """
        if not self._ground_reflection:
            return np.ones(len(range_m))
        range_m, heights_m = np.maximum(range_m, 1.0), np.maximum(target_height_m, 0.0)
        wave_per_m = 2 * math.pi / self._wavelength_m
        phase = wave_per_m * 2 * self._height_m * heights_m / range_m
        grazing = (self._height_m + heights_m) / range_m
        rough = np.exp(-2 * (wave_per_m * ROAD_ROUGHNESS_M * grazing) ** 2)
        rho = -self._ground_reflection * rough
        return np.asarray((1 + 2 * rho * np.cos(phase) + rho**2) ** 2)


def rain_db_per_km(weather: Weather) -> float:
    """One-way attenuation at 77 GHz: k R^alpha of ITU-R P.838-3, for rain. Fog and dry snow attenuate less
    than 1 dB over the range of any automotive radar."""
    return 1.13 * weather.rate_mm_per_h**0.714 if weather.kind == "rain" else 0.0
