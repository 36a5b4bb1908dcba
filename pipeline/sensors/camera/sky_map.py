"""The sky as a picture: quick to look up, with clouds, and the light that it sheds on surfaces."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.camera.daylight import Daylight

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

SIDE = 768
"""Pixels of the map's side; the upper half of the sphere is projected from the nadir onto a disc."""

GROUND = np.array([0.13, 0.125, 0.115])
"""Reflectance of the ground as surfaces and mirrors see it from afar."""


class SkyMap:
    """The sky of one daylight.

    ambient: (4, 3) float32, irradiance / pi of an unshaded surface as a linear function of (1, normal): the
    first two bands of spherical harmonics (Ramamoorthi and Hanrahan 2001). ground: (3,) luminance below the
    horizon.
    """

    def __init__(self, daylight: Daylight, rng: np.random.Generator) -> None:
        self.daylight = daylight
        place = (np.arange(SIDE) + 0.5) / SIDE * 2.1 - 1.05
        x, y = np.meshgrid(place, place, indexing="xy")
        square = np.minimum(x * x + y * y, 1.0)
        up = (1 - square) / (1 + square)
        directions = np.stack([x * (1 + up), y * (1 + up), up], axis=-1).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        sky = daylight.sky(directions)
        self.ground = self._ground(sky, directions)
        clouded = _with_clouds(sky, directions, daylight, rng)
        self._map: Float32 = np.ascontiguousarray(clouded.T, np.float32)
        self.ambient = self._ambient(clouded, directions).astype(np.float32)
        self.horizon: Float32 = (
            clouded[np.abs(directions[:, 2] - 0.05) < 0.03].mean(axis=0).astype(np.float32)
        )

    def luminance(self, directions: Float32) -> Float32:
        """The luminance (3, N) towards unit vectors (3, N); that of the ground below the horizon."""
        x, y, up = directions
        scale = np.float32(SIDE / 2.1) / (1 + np.maximum(up, np.float32(0)))
        half = np.float32(SIDE / 2)
        place = (y * scale + half).astype(np.int32)
        place *= SIDE
        place += (x * scale + half).astype(np.int32)
        found = np.empty((3, len(up)), np.float32)
        for channel in range(3):
            np.take(self._map[channel], place, out=found[channel], mode="clip")
        below = np.flatnonzero(up < 0)
        found[:, below] = self.ground[:, None]
        return found

    def _ground(self, sky: Float64, directions: Float64) -> Float32:
        weight = _solid_angles(directions) * directions[:, 2]
        light = (sky * weight[:, None]).sum(axis=0) + self.daylight.sun_light * max(self.daylight.sun[2], 0.0)
        ground: Float32 = (light * GROUND / np.pi).astype(np.float32)
        return ground

    def _ambient(self, sky: Float64, directions: Float64) -> Float64:
        """Irradiance / pi = c0 A0 + c1 A1 . n, of the sky and the ground below it."""
        weight = _solid_angles(directions)
        below = directions * (1, 1, -1)
        light = np.concatenate([sky, np.broadcast_to(self.ground, sky.shape)]) * np.tile(weight, 2)[:, None]
        towards = np.concatenate([directions, below])
        constant = light.sum(axis=0) / (4 * np.pi)
        linear = towards.T @ light / (2 * np.pi)
        ambient: Float64 = np.concatenate([constant[None], linear])
        return ambient


def _solid_angles(directions: Float64) -> Float64:
    """Solid angle of each pixel of the map; 0 outside the disc."""
    place = (np.arange(SIDE) + 0.5) / SIDE * 2.1 - 1.05
    x, y = np.meshgrid(place, place, indexing="xy")
    square = (x * x + y * y).ravel()
    weight = np.where(square <= 1, 4 / (1 + square) ** 2, 0.0)
    angles: Float64 = weight * 2 * np.pi / weight.sum()
    return angles


def _with_clouds(sky: Float64, directions: Float64, daylight: Daylight, rng: np.random.Generator) -> Float64:
    """Fair-weather clouds in a clear sky; the unevenness of a covered one."""
    far = 1 / np.maximum(directions[:, 2], 0.04)
    cloud = _sampled(_cloud_noise(rng), directions[:, 0] * far * 42, directions[:, 1] * far * 42)
    if daylight.is_overcast:
        return sky * (1 + 0.10 * np.clip(cloud, -2, 2) * np.clip(directions[:, 2] * 3, 0, 1))[:, None]
    if daylight.is_dark:
        return sky
    cover = np.clip((cloud - 0.5) * 1.1, 0, 1)
    cover *= np.clip((directions[:, 2] - 0.02) * 7, 0, 1)
    cover = cover * cover * (3 - 2 * cover) * 0.85
    brightness = (
        sky[:, 1].mean() * 1.1 + daylight.sun_light * max(daylight.sun[2], 0.05) ** 0.5 / np.pi * 0.55
    )
    shade = 1.0 - 0.25 * np.clip(cloud - 1.2, 0, 1)
    clouded: Float64 = sky * (1 - cover)[:, None] + cover[:, None] * shade[:, None] * brightness
    return clouded


def _sampled(noise: Float64, u: Float64, v: Float64) -> Float64:
    """Periodic noise (1024, 1024) at places (N,), bilinear."""
    column, row = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    right, down = u - column, v - row
    a, b = (
        noise[(row + k) % 1024, column % 1024] * (1 - right)
        + noise[(row + k) % 1024, (column + 1) % 1024] * right
        for k in (0, 1)
    )
    sampled: Float64 = a * (1 - down) + b * down
    return sampled


def _cloud_noise(rng: np.random.Generator) -> Float64:
    """Periodic noise (1024, 1024) of unit variance with a steep spectrum."""
    frequency = np.fft.fftfreq(1024)
    radius = np.hypot(frequency[:, None], frequency)
    radius[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal((1024, 1024))) / (radius + 0.004) ** 1.9
    noise = np.fft.ifft2(spectrum).real
    scaled: Float64 = noise / noise.std()
    return scaled
