"""A GNSS receiver: white noise plus an offset that drifts as a first-order Gauss-Markov process."""

from __future__ import annotations

import math

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.section import GnssSensor

HEIGHT_FACTOR = 2.0
"""Heights err by twice as much as horizontal axes."""


class GnssReceiver:
    """Fixes in the map's frame, one every `interval_s`; the offset starts in its stationary distribution.

    The first-order Gauss-Markov process for residual orbit, clock and atmosphere errors, and white noise
    for the receiver's own, are the usual pair (Brown and Hwang, "Introduction to random signals and
    applied Kalman filtering").
    """

    def __init__(self, sensor: GnssSensor, interval_s: float, rng: np.random.Generator) -> None:
        self._rng = rng
        axes = np.array([1.0, 1.0, HEIGHT_FACTOR])
        self._white_m = sensor.white_stddev_m * axes
        self._drift_m = sensor.drift_stddev_m * axes
        self._memory = float(np.exp(-interval_s / sensor.drift_time_s))
        self._offset_m = self._drift_m * rng.standard_normal(3)

    @property
    def covariance_m2(self) -> Float64:
        """Covariance (3, 3) of one fix about the truth."""
        return np.diag(self._white_m**2 + self._drift_m**2)

    def fix(self, position_m: Float64) -> Float64:
        """The next fix (3,) at a true position (3,)."""
        kick = np.sqrt(1 - self._memory**2) * self._drift_m * self._rng.standard_normal(3)
        self._offset_m = self._memory * self._offset_m + kick
        noisy: Float64 = position_m + self._offset_m + self._white_m * self._rng.standard_normal(3)
        return noisy


def squared_sigmas(offset_m: Float64, covariance_m2: Float64) -> float:
    """offset' covariance^-1 offset of an offset (3,) and a covariance (3, 3); infinite along an axis without
    errors."""
    if not offset_m.any():
        return 0.0
    values, axes = np.linalg.eigh(covariance_m2)
    parts = np.square(axes.T @ offset_m)
    if (parts[values <= 0] > 0).any():
        return math.inf
    return float(sum(part / value for part, value in zip(parts, values, strict=True) if value > 0))
