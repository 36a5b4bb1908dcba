"""The effect of rain, snow and fog on a LiDAR: attenuation, and echoes from the air.

Rain and snow follow LISA (Kilic, Hegde, Sindagi, Cooper, Foster, Patel: Lidar Light Scattering
Augmentation, arXiv 2107.07004): extinction from the particles' size distribution, and a Monte Carlo draw
of single particles in the beam; the strongest echo may exceed that of the target behind it. Fog follows
Hahner, Sakaridis, Dai, Van Gool: Fog Simulation on Real LiDAR Point Clouds (ICCV 2021), after Rasshofer,
Spies, Spies: Influences of weather phenomena on automotive laser radar systems (2011).

LISA detects every echo above the noise. An earlier version asked for one step of an 8-bit reflectivity, and
lost nearly all drops: 0.05 % of the rays had an echo at 10 mm/h. Now 0.7 % have, most within 3 m; and rain
wets the ground, whose returns are the first to go (Filgueira et al., Quantifying the influence of rain in
LiDAR performance, Measurement 2017); see `intensity.wet_share`.

Not modelled: spray behind vehicles, drops on the sensor's window, wind.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.intensity import noise_floor
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.weather import Weather

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

ASSUMED_REFLECTIVITY = 0.9
"""The `range_reflectivity` assumed in bad weather for a sensor without one; LISA assumes a white target."""

FAINTEST_PARTICLE, FAINTEST_FOG = 1e-3, 1 / 255
"""Smallest signal of an echo from the air that is detected, however near: the receivers' range of power has
an end. That of a single particle may be less than one step of an 8-bit reflectivity, and then has an
intensity of 0. The soft echo of fog has no edge, and needs such a step."""

NEAREST_M, FULL_VIEW_M = 0.9, 1.0
"""The receiver's field of view covers none of the beam before the first range, and all of it beyond the
second (R1 and R2 of Hahner et al.)."""

DIVERGENCE_RAD = 3e-3
"""Full angle of the beam in LISA; the data sheets of VLP-16 and OS1 state the same, 0.18 degrees."""

PULSE_M = 299_792_458.0 * 5e-9
"""Length in air of a pulse with a width of 5 ns at half power, as stated for HDL-64E."""


class Echoes(NamedTuple):
    """The strongest echo of the air along each of K rays.

    rays: (K,) int64, each at most once. range_m: (K,) float32. signal: (K,) float32, as the reflectivity of a
    diffuse target in clear air with the same return.
    """

    rays: npt.NDArray[np.int64]
    range_m: Float32
    signal: Float32


class Atmosphere(Protocol):
    """The air between a LiDAR and the world. extinction_per_m: the extinction coefficient alpha."""

    extinction_per_m: float

    def echoes(self, rays: int, rng: np.random.Generator) -> Echoes:
        """The echoes of the air along `rays` rays, without any targets."""
        ...


def atmosphere_of(weather: Weather, sensor: LidarSensor) -> Atmosphere | None:
    """The air for one sensor; None for clear weather."""
    if weather.kind == "clear":
        return None
    if weather.kind == "fog":
        return Fog(weather.visibility_m, sensor)
    rate = weather.rate_mm_per_h
    return rain(rate, sensor) if weather.kind == "rain" else snow(rate, sensor)


def transmission(air: Atmosphere, range_m: Float32) -> Float32:
    """Two-way transmission (N,): exp(-2 alpha R), Beer and Lambert."""
    transmitted: Float32 = np.exp(range_m * np.float32(-2 * air.extinction_per_m))
    return transmitted


def needed_signal(sensor: LidarSensor, range_m: Float64, faintest: float = FAINTEST_PARTICLE) -> Float64:
    """Minimum signal (N,) at each range for an echo from the air to be detected, at least `faintest`."""
    floor = noise_floor(sensor, range_m.astype(np.float32), sensor.range_reflectivity or ASSUMED_REFLECTIVITY)
    return np.maximum(floor.astype(np.float64), faintest)


def rain(rate_mm_per_h: float, sensor: LidarSensor) -> Particles:
    """Rain drops by Marshall and Palmer (1948): N(D) = 8000 exp(-4.1 R^-0.21 D) per m^3 and mm.

    A drop reflects specularly, by Fresnel reflection at normal incidence: ((n - 1)/(n + 1))^2 = 0.02.
    """
    slope_per_mm = 4.1 * rate_mm_per_h**-0.21
    return Particles(8000.0, slope_per_mm, 0.02, rain_extinction_per_m(rate_mm_per_h), sensor)


def snow(rate_mm_per_h: float, sensor: LidarSensor) -> Particles:
    """Snow flakes by Gunn and Marshall (1958): N(D) = 3800 R^-0.87 exp(-2.55 R^-0.48 D), D and R melted.

    A flake scatters like a surface of reflectivity 0.9 (Hahner et al., LiDAR Snowfall Simulation, CVPR 2022).
    Its density is a tenth of water's, so it covers 10^(2/3) times the area of the drop that it melts to.
    """
    density = 3.8e3 * rate_mm_per_h**-0.87
    slope_per_mm = 2.55 * rate_mm_per_h**-0.48
    return Particles(density, slope_per_mm, 0.9, snow_extinction_per_m(rate_mm_per_h), sensor)


def rain_extinction_per_m(rate_mm_per_h: float) -> float:
    """The extinction coefficient of rain."""
    return _extinction_per_m(8000.0, 4.1 * rate_mm_per_h**-0.21)


def snow_extinction_per_m(rate_mm_per_h: float) -> float:
    """The extinction coefficient of snow."""
    slope_per_mm = 2.55 * rate_mm_per_h**-0.48
    return 10 ** (2 / 3) * _extinction_per_m(3.8e3 * rate_mm_per_h**-0.87, slope_per_mm)


def _extinction_per_m(density: float, slope_per_mm: float) -> float:
    """alpha = pi/4 Q integral of D^2 N(D) dD, with Q = 2 for particles far wider than the wavelength."""
    square_millimetres_per_m3 = np.pi / 4 * 2 * density * 2 / slope_per_mm**3
    return float(square_millimetres_per_m3 * 1e-6)


class Particles:
    """Drops or flakes with exponentially distributed diameters: N(D) = density exp(-slope D).

    LISA draws every particle in a beam and keeps the strongest echo. Most echoes are far too weak to be
    detected. Here only detectable ones are drawn, which gives the same strongest echoes: particles in
    disjoint volumes are independent, and the exponential distribution is memoryless.
    """

    def __init__(
        self,
        density_per_m3_mm: float,
        slope_per_mm: float,
        reflectivity: float,
        extinction_per_m: float,
        sensor: LidarSensor,
    ) -> None:
        self.extinction_per_m = extinction_per_m
        self._slope_per_mm, self._reflectivity = slope_per_mm, reflectivity
        range_m = np.linspace(NEAREST_M, sensor.range, 4096)
        # A particle reflects the share of the beam's cross-section that it fills, at most the whole beam.
        share = needed_signal(sensor, range_m) * np.exp(2 * extinction_per_m * range_m) / reflectivity
        least_mm = 1e3 * DIVERGENCE_RAD * range_m * np.sqrt(share)
        beam_m2 = np.pi / 4 * (DIVERGENCE_RAD * range_m) ** 2
        count_per_m3 = density_per_m3_mm / slope_per_mm * np.exp(-slope_per_mm * least_mm)
        per_m = np.where(share <= 1, beam_m2 * count_per_m3, 0.0)
        self._expected, self._quantiles = _integral_and_quantiles(range_m, per_m, range_m, least_mm)

    def echoes(self, rays: int, rng: np.random.Generator) -> Echoes:
        count = int(rng.poisson(rays * self._expected))
        hit = rng.integers(0, rays, count)
        range_m, diameter_mm = _interpolated(self._quantiles, rng.random(count))
        diameter_mm += rng.standard_exponential(count) / self._slope_per_mm
        filled = np.minimum(diameter_mm / (1e3 * DIVERGENCE_RAD * range_m), 1) ** 2
        signal = self._reflectivity * filled * np.exp(-2 * self.extinction_per_m * range_m)
        power = signal / range_m**2
        strongest = np.zeros(rays)
        np.maximum.at(strongest, hit, power)
        chosen = np.flatnonzero(power == strongest[hit])
        return Echoes(hit[chosen], range_m[chosen].astype(np.float32), signal[chosen].astype(np.float32))


class Fog:
    """Fog: many droplets that are not resolved, a soft target (Hahner et al., equations 3 to 10).

    alpha = ln 20 / MOR and beta = 0.046 / MOR. A sin^2 pulse of length L sends back
    P(r) = pi beta integral of sin^2(pi x / L) xi(r') exp(-2 alpha r') / r'^2 dx with r' = r + L/2 - x,
    relative to a white diffuse target, whose differential reflectivity is 1/pi.

    Hahner et al. place the echo at the maximum of P and add uniform noise. Here, since fog is patchy, the
    strength of each ray's echo is exponentially distributed with mean P, and its range is drawn from the
    density P.
    """

    def __init__(self, visibility_m: float, sensor: LidarSensor) -> None:
        self.extinction_per_m = float(np.log(20) / visibility_m)
        step_m = 0.01
        range_m = np.arange(NEAREST_M / 2, min(sensor.range, 60.0), step_m)
        overlap = np.clip((range_m - NEAREST_M) / (FULL_VIEW_M - NEAREST_M), 0, 1)
        path = overlap * np.exp(-2 * self.extinction_per_m * range_m) / range_m**2
        pulse = np.sin(np.pi * np.arange(step_m / 2, PULSE_M, step_m) / PULSE_M) ** 2
        power = np.pi * 0.046 / visibility_m * np.convolve(path, pulse, mode="same") * step_m
        power[range_m < NEAREST_M] = 0.0
        signal = power * range_m**2
        share = signal / needed_signal(sensor, range_m, FAINTEST_FOG)
        self._largest_share = np.float32(share.max())
        _, self._quantiles = _integral_and_quantiles(range_m, power, range_m, signal, share)

    def echoes(self, rays: int, rng: np.random.Generator) -> Echoes:
        patch = rng.standard_exponential(rays, dtype=np.float32)
        uniform = rng.random(rays, dtype=np.float32)
        candidates = np.flatnonzero(patch * self._largest_share >= 1)
        range_m, signal, share = _interpolated(self._quantiles, uniform[candidates])
        detected = np.flatnonzero(patch[candidates] * share >= 1)
        hit, signal = candidates[detected], patch[candidates[detected]] * signal[detected]
        return Echoes(hit, range_m[detected].astype(np.float32), signal.astype(np.float32))


_QUANTILES = 4096


def _integral_and_quantiles(range_m: Float64, per_m: Float64, *columns: Float64) -> tuple[float, Float64]:
    """The integral of a density over the range, and columns (C, Q + 1) at evenly spaced quantiles of it."""
    parts = (per_m[1:] + per_m[:-1]) / 2 * np.diff(range_m)
    total = np.concatenate([[0.0], np.cumsum(parts)])
    at_m = np.interp(np.linspace(0, total[-1], _QUANTILES + 1), total, range_m)
    return float(total[-1]), np.array([np.interp(at_m, range_m, column) for column in columns])


def _interpolated(quantiles: Float64, uniform: npt.NDArray[np.floating]) -> Float64:
    """The columns (C, N) at the quantiles `uniform` (N,) in [0, 1)."""
    position = uniform * np.float64(_QUANTILES)
    below = np.minimum(position.astype(np.int64), _QUANTILES - 1)
    part = position - below
    columns: Float64 = quantiles[:, below] * (1 - part) + quantiles[:, below + 1] * part
    return columns
