"""The filter in closed form against the textbook's matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.kalman import LONGEST_STEP_S, Kalman


def test_as_with_matrices() -> None:
    rng = np.random.default_rng(3)
    filtered = Kalman(2.0, 0.5, 0.2)
    noise = np.diag([0.25, 0.25, 0.04, 0.04])
    state, covariance = np.zeros(4), noise.copy()
    for number in range(8):
        t = float(rng.uniform(0.1, 1.6))
        measured = np.concatenate([rng.normal(0, 5, 2), rng.normal(0, 2, 2)])
        found = filtered.innovation(t, (measured[0], measured[1]), (measured[2], measured[3]))
        filtered.accept()
        if number == 0:
            state = measured
            assert found == 0.0
            continue
        steps = math.ceil(t / LONGEST_STEP_S)
        for _ in range(steps):
            part = t / steps
            forward = np.eye(4)
            forward[0, 2] = forward[1, 3] = part
            kick = np.array([[part * part / 2, 0], [0, part * part / 2], [part, 0], [0, part]]) * 2.0
            state, covariance = forward @ state, forward @ covariance @ forward.T + kick @ kick.T
        off, spread = measured - state, covariance + noise
        assert found == pytest.approx(float(off @ np.linalg.solve(spread, off)), rel=1e-9)
        gain = covariance @ np.linalg.inv(spread)
        state, covariance = state + gain @ off, covariance - gain @ covariance


def test_looking_does_not_take() -> None:
    filtered = Kalman(2.0, 0.5, 0.2)
    filtered.innovation(0.0, (0.0, 0.0), (10.0, 0.0))
    filtered.accept()
    far = filtered.innovation(0.5, (500.0, 0.0), (10.0, 0.0))
    near = filtered.innovation(0.5, (5.0, 0.0), (10.0, 0.0))
    assert far > 1000
    assert near == pytest.approx(0.0, abs=1e-12)


def test_where_messages_are_missing_the_driver_may_brake_late() -> None:
    """3 s at 10 m/s, the last one braking to a stop at 10 m/s²: far from a constant acceleration."""
    filtered = Kalman(4.0, 0.2, 0.15)
    filtered.innovation(0.0, (0.0, 0.0), (10.0, 0.0))
    filtered.accept()
    assert filtered.innovation(3.0, (25.0, 0.0), (0.0, 0.0)) < 10


def test_a_turn_swings_the_box() -> None:
    filtered = Kalman(2.0, 0.5, 0.2)
    filtered.innovation(0.0, (0.0, 0.0), (10.0, 0.0))
    filtered.accept()
    still = filtered.innovation(0.1, (1.0, 1.0), (10.0, 0.0))
    assert filtered.innovation(0.1, (1.0, 1.0), (10.0, 0.0), swing_m=2.0) < still / 4
