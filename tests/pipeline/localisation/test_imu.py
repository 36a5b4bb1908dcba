"""The IMU errs as its data sheet's two figures say, in the Allan deviation and in the long run."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.imu import ImuModel
from advpipe.pipeline.localisation.section import ImuSensor


def allan_deviation(values: Float64, samples: int) -> Float64:
    """IEEE Std 952: half the mean square of the difference of neighbouring means over `samples` each."""
    means = values[: len(values) // samples * samples].reshape(-1, samples, values.shape[1]).mean(axis=1)
    deviation: Float64 = np.sqrt(np.mean(np.diff(means, axis=0) ** 2, axis=0) / 2)
    return deviation


def errors(sensor: ImuSensor, steps: int, seed: int = 1) -> Float64:
    imu = ImuModel(sensor, 0.1, np.random.default_rng(seed))
    still = np.zeros((10, 3))
    return np.concatenate([np.hstack(imu.measure(still, still)) for _ in range(steps)])


def test_white_noise_has_the_stated_density() -> None:
    sensor = ImuSensor(
        accelerometer_noise_density=0.002,
        gyroscope_noise_density=0.0003,
        accelerometer_bias_stddev_mps2=0,
        gyroscope_bias_stddev_radps=0,
    )
    noise = errors(sensor, 40_000)  # 4000 s
    densities = np.repeat([0.002, 0.0003], 3)
    assert noise.std(axis=0) == pytest.approx(densities * 10, rel=0.01)  # sqrt(100 Hz)
    for seconds in (0.1, 1, 4):
        expected = densities / np.sqrt(seconds)
        assert allan_deviation(noise, round(100 * seconds)) == pytest.approx(expected, rel=0.08)


def test_biases_keep_their_size_and_forget_in_their_time() -> None:
    sensor = ImuSensor(
        accelerometer_noise_density=0,
        gyroscope_noise_density=0,
        accelerometer_bias_stddev_mps2=0.04,
        gyroscope_bias_stddev_radps=0.002,
        bias_time_s=5,
    )
    first = np.array([errors(sensor, 1, seed)[0] for seed in range(3000)])
    assert first.std(axis=0) == pytest.approx(np.repeat([0.04, 0.002], 3), rel=0.06)
    long = errors(sensor, 60_000)[::10]
    assert long.std(axis=0) == pytest.approx(np.repeat([0.04, 0.002], 3), rel=0.1)
    later = np.mean(long[:-50] * long[50:], axis=0) / np.var(long, axis=0)
    assert later == pytest.approx(np.full(6, np.exp(-1)), abs=0.08)


def test_full_scale() -> None:
    imu = ImuModel(
        ImuSensor(accelerometer_range_mps2=30, gyroscope_range_radps=2), 0.1, np.random.default_rng(0)
    )
    force, rate = imu.measure(np.full((4, 3), [500.0, -500.0, 9.8]), np.full((4, 3), [0.0, -9.0, 9.0]))
    assert (force[:, :2] == [30, -30]).all()
    assert (rate[:, 1:] == [-2, 2]).all()
    assert np.abs(force[:, 2] - 9.8).max() < 0.5
