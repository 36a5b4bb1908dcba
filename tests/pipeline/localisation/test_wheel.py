"""Wheels: errors as large as stated, and dead reckoning as uncertain as it says."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.localisation.measurements import WheelTwist
from advpipe.pipeline.localisation.section import WheelOdometrySensor
from advpipe.pipeline.localisation.wheel import DeadReckoning, WheelOdometer

SENSOR = WheelOdometrySensor()


def test_errors_have_the_stated_sizes() -> None:
    twists = []
    for seed in range(4000):
        twist = WheelOdometer(SENSOR, np.random.default_rng(seed)).measure(20.0, 0.5)
        twists.append([twist.speed_mps, twist.turn_rate_radps])
    assert np.mean(twists, axis=0) == pytest.approx([20, 0.5], abs=0.006)
    # white 0.05 and 0.5 % of 20 m/s; white 0.01, 1 % of 0.5 rad/s and 0.0006 rad/m at 20 m/s
    speed, turn = np.hypot(0.05, 0.1), np.sqrt(0.01**2 + 0.005**2 + 0.012**2)
    assert np.std(twists, axis=0) == pytest.approx([speed, turn], rel=0.04)


def test_systematic_errors_stay() -> None:
    odometer = WheelOdometer(SENSOR, np.random.default_rng(3))
    means = [np.mean([odometer.measure(20.0, 0.0).speed_mps for _ in range(4000)]) for _ in range(2)]
    assert abs(means[0] - 20) > 0.02
    assert means[0] == pytest.approx(means[1], abs=0.004)


def test_a_circle_closes() -> None:
    """2 m/s and 0.25 rad/s: a circle of 8 m radius; after half of it the vehicle is 16 m to the left."""
    reckoning = DeadReckoning(SENSOR, 0.1)
    half = round(np.pi / 0.25 / 0.1)
    for _ in range(half + 1):
        odometry = reckoning.advance(WheelTwist(2.0, 0.25))
    angle = 0.025 * half
    expected = [8 * np.sin(angle), 8 - 8 * np.cos(angle), 0]
    assert odometry.odom_SE3_base[:3, 3] == pytest.approx(expected, abs=0.01)
    assert expected[1] == pytest.approx(16, abs=0.01)


def test_dead_reckoning_errs_as_much_as_it_says() -> None:
    """150 runs of 10 s: the mean of the normalised squared errors lies in the 99 % interval of 450 / 150."""
    turns = 0.2 * np.sin(np.arange(100) * 0.08)
    exact = DeadReckoning(SENSOR, 0.1)
    truth = [exact.advance(WheelTwist(12.0, turn)) for turn in turns][-1].odom_SE3_base
    squares = []
    for seed in range(150):
        odometer = WheelOdometer(SENSOR, np.random.default_rng([5, seed]))
        reckoning = DeadReckoning(SENSOR, 0.1)
        end = [reckoning.advance(odometer.measure(12.0, turn)) for turn in turns][-1]
        difference = truth.T @ end.odom_SE3_base
        yaw = np.arctan2(difference[1, 0], difference[0, 0])
        error = np.array([*(end.odom_SE3_base - truth)[:2, 3], yaw])
        planar = np.ix_([0, 1, 5], [0, 1, 5])
        squares.append(error @ np.linalg.solve(end.pose_covariance[planar], error))
    assert 2.51 < np.mean(squares) < 3.54
    assert end.pose_covariance[2, 2] == 1e6  # a height is not measured
