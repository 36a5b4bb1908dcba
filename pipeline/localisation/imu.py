"""Accelerometers and gyroscopes with white noise, drifting biases and a full scale."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.section import ImuSensor


class ImuModel:
    """One inertial sensor at base_link's origin, aligned with it.

    The model of IEEE Std 952 and of Kalibr: white noise of density N, which at a rate f has the standard
    deviation N sqrt(f) (in the Allan deviation N / sqrt(T)), plus a bias. The bias is a first-order
    Gauss-Markov process (IEEE Std 952 annex B) that starts in its stationary distribution, which stands
    for turn-on bias and bias instability; it is constant during a step.
    """

    def __init__(self, sensor: ImuSensor, step_s: float, rng: np.random.Generator) -> None:
        self._rng = rng
        self._white = np.sqrt(sensor.rate_hz) * np.repeat(
            [sensor.accelerometer_noise_density, sensor.gyroscope_noise_density], 3
        )
        self._range = np.repeat([sensor.accelerometer_range_mps2, sensor.gyroscope_range_radps], 3)
        self._bias_stddev = np.repeat(
            [sensor.accelerometer_bias_stddev_mps2, sensor.gyroscope_bias_stddev_radps], 3
        )
        self._memory = float(np.exp(-step_s / sensor.bias_time_s))
        self._bias = self._bias_stddev * rng.standard_normal(6)

    def measure(self, specific_force_mps2: Float64, angular_rate_radps: Float64) -> tuple[Float64, Float64]:
        """Measured specific force (n, 3) and angular rate (n, 3) of the true ones of one step."""
        kick = np.sqrt(1 - self._memory**2) * self._bias_stddev * self._rng.standard_normal(6)
        self._bias = self._memory * self._bias + kick
        truth = np.hstack([specific_force_mps2, angular_rate_radps])
        noisy = truth + self._bias + self._white * self._rng.standard_normal(truth.shape)
        clipped = np.clip(noisy, -self._range, self._range)
        return clipped[:, :3], clipped[:, 3:]
