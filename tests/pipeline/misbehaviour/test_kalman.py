"""The filter in closed form against the textbook's matrices."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.kalman import Kalman


def test_as_with_matrices() -> None:
    rng = np.random.default_rng(3)
    filtered = Kalman(2.0, 0.5, 0.2)
    noise = np.diag([0.25, 0.25, 0.04, 0.04])
    state, covariance = np.zeros(4), noise.copy()
    for number in range(8):
        t = float(rng.uniform(0.1, 1.5))
        measured = np.concatenate([rng.normal(0, 5, 2), rng.normal(0, 2, 2)])
        found = filtered.innovation(t, (measured[0], measured[1]), (measured[2], measured[3]))
        filtered.accept()
        if number == 0:
            state = measured
            assert found == 0.0
            continue
        forward = np.eye(4)
        forward[0, 2] = forward[1, 3] = t
        kick = np.array([[t * t / 2, 0], [0, t * t / 2], [t, 0], [0, t]]) * 2.0
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
