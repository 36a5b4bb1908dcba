"""The electronics behind the lens: auto-exposure, noise, and the curve to eight bits."""

from __future__ import annotations

from concurrent.futures import Executor
from functools import cache

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.camera.section import CameraSensor

Float32 = npt.NDArray[np.float32]
UInt8 = npt.NDArray[np.uint8]

KEY = 0.2
"""Where auto-exposure puts the geometric mean of the picture, 1 being white before the curve."""

FULL_WELL, READ_NOISE = 11_000.0, 4.0
"""Electrons of white at ISO 100, and the deviation of the read-out (EMVA 1288's linear model)."""

BASE_EXPOSURE = 0.12
"""Exposure per kcd/m^2 up to which the sensor keeps its least gain: that of a day in shade."""

MOST_GAIN = 20.0
"""Gain from which on the sensor exposes for longer instead."""

WHITE = 6.0
"""What the curve maps to 255."""

_STEPS, _NORMALS, _PART = 4096, 1 << 20, 1 << 16


def levels_of(signal: Float32) -> UInt8:
    """The levels 0 to 255 of an exposed signal, 1 being white before the curve, as `Exposure` has them."""
    place = np.sqrt(np.clip(signal, 0, WHITE) / np.float32(WHITE)) * np.float32(_STEPS - 1)
    levels: UInt8 = np.take(_curve(), place.astype(np.int32))
    return levels


def signal_of(levels: UInt8) -> Float32:
    """The inverse of `levels_of`: the middle of the signals that have a level."""
    return _signals()[levels]


@cache
def _signals() -> Float32:
    """The signal of each of the 256 levels."""
    curve, signals = _curve(), WHITE * np.linspace(0, 1, _STEPS) ** 2
    known, first = np.unique(curve, return_index=True)
    last = np.append(first[1:], _STEPS) - 1
    middle = (signals[first] + signals[last]) / 2
    found: Float32 = np.interp(np.arange(256), known, middle).astype(np.float32)
    return found


class Exposure:
    """One camera's exposure, which follows the light from image to image."""

    def __init__(self, sensor: CameraSensor, rng: np.random.Generator) -> None:
        self._speed, self._stops = sensor.exposure_speed, sensor.exposure_compensation
        self._gain, self._noise = sensor.iso / 100.0, sensor.noise
        self._normals = rng.standard_normal(_NORMALS, dtype=np.float32) if sensor.noise else None
        self._log_exposure: float | None = None
        self._curve = _curve()

    def develop(self, radiance: Float32, rng: np.random.Generator, workers: Executor | None = None) -> UInt8:
        """The image (H, W, 3) of a radiance (3, H, W) in kcd/m^2, which is overwritten. workers: to help."""
        exposure = self._follow(radiance)
        start = int(rng.integers(_NORMALS)) if self._normals is not None else 0
        linear = radiance.reshape(-1)
        levels = np.empty(len(linear), np.uint8)

        def code(first: int) -> None:
            part = slice(first, first + _PART)
            levels[part] = self._coded(linear[part], exposure, (start + first) % _NORMALS)

        list((workers.map if workers else map)(code, range(0, len(linear), _PART)))
        return np.ascontiguousarray(levels.reshape(radiance.shape).transpose(1, 2, 0))

    def _coded(self, linear: Float32, exposure: float, start: int) -> UInt8:
        """The levels (N,) of radiances (N,), which are overwritten; start: of their noise."""
        linear *= np.float32(exposure)
        if self._normals is not None:
            gain = self._gain * min(max(exposure / BASE_EXPOSURE, 1.0), MOST_GAIN)
            shot, read = gain / FULL_WELL, (READ_NOISE * gain / FULL_WELL) ** 2
            deviation = linear * np.float32(shot)
            deviation += np.float32(read)
            np.sqrt(deviation, out=deviation)
            split = min(_NORMALS - start, len(linear))
            deviation[:split] *= self._normals[start : start + split]
            deviation[split:] *= self._normals[: len(linear) - split]
            deviation *= np.float32(self._noise)
            linear += deviation
        np.clip(linear, 0, WHITE, out=linear)
        linear *= np.float32(1 / WHITE)
        np.sqrt(linear, out=linear)
        linear *= np.float32(_STEPS - 1)
        return np.take(self._curve, linear.astype(np.intp), mode="clip")

    def _follow(self, radiance: Float32) -> float:
        """The exposure in 1/(kcd/m^2), on its way from the last one to that of this picture."""
        rows = radiance[1, radiance.shape[1] // 6 :: 4, ::4]
        rows = rows[rows > 0] if (rows > 0).any() else rows  # beside a fisheye's image circle is nothing
        wanted = float(np.log(KEY) - np.log(np.maximum(rows, 1e-5)).mean())
        last = wanted if self._log_exposure is None else self._log_exposure
        self._log_exposure = last + self._speed * (wanted - last)
        return float(np.exp(min(self._log_exposure, np.log(60.0)) + self._stops * np.log(2.0)))


@cache
def _curve() -> UInt8:
    """`curve`, rounded."""
    levels: UInt8 = np.rint(curve()).astype(np.uint8)
    return levels


@cache
def curve() -> npt.NDArray[np.float64]:
    """sRGB's curve after a shoulder (Reinhard et al. 2002, equation 4): levels from 0 to 255 at equal steps
    of the square root of the signal, from 0 to that of `WHITE`."""
    signal = WHITE * np.linspace(0, 1, _STEPS) ** 2
    signal = signal * 1.15
    toned = np.clip(signal * (1 + signal / WHITE**2) / (1 + signal) * (1 + 1 / WHITE) * 1.02, 0, 1)
    toned = toned**1.08  # a little more contrast than the scene's
    coded = np.where(toned > 0.0031308, 1.055 * toned ** (1 / 2.4) - 0.055, 12.92 * toned)
    levels: npt.NDArray[np.float64] = np.clip(coded * 255, 0, 255)
    return levels
