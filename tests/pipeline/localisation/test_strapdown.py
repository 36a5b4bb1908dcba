"""A step of inertial navigation at once: as a plain loop does it, with the derivatives that a loop has."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.strapdown import integrate

RNG = np.random.default_rng(4)
START = Rotation.from_rotvec([0.1, -0.2, 2.0])
DURATIONS_S = np.array([0.01, 0.01, 0.03, 0.02, 0.01])
FORCE = RNG.normal([1, 2, 9.8], 3, (5, 3))
RATE = RNG.normal(0, 1, (5, 3))


def loop(start: Rotation, force: Float64, rate: Float64) -> tuple[Float64, Float64, Rotation]:
    position, velocity = np.zeros(3), np.zeros(3)
    for seconds, f, w in zip(DURATIONS_S, force, rate, strict=True):
        half = Rotation.from_rotvec(w * seconds / 2)
        acceleration = (start * half).apply(f) - [0, 0, 9.80665]
        position = position + velocity * seconds + acceleration * seconds**2 / 2
        velocity = velocity + acceleration * seconds
        start = start * half * half
    return position, velocity, start


def test_sums_are_those_of_a_loop() -> None:
    moved = integrate(START.as_matrix(), DURATIONS_S, FORCE, RATE)
    position, velocity, end = loop(START, FORCE, RATE)
    assert moved.duration_s == pytest.approx(0.08)
    assert moved.position_m == pytest.approx(position, abs=1e-14)
    assert moved.velocity_mps == pytest.approx(velocity, abs=1e-14)
    assert moved.rotation == pytest.approx(end.as_matrix(), abs=1e-14)


def test_derivatives_are_those_of_a_loop() -> None:
    moved = integrate(START.as_matrix(), DURATIONS_S, FORCE, RATE)
    here = loop(START, FORCE, RATE)
    tiny = 1e-6
    for axis in range(3):
        error = tiny * np.eye(3)[axis]
        position, velocity, _ = loop(START, FORCE + error, RATE)
        assert (position - here[0]) / tiny == pytest.approx(moved.pushed_s2[:, axis], abs=1e-8)
        assert (velocity - here[1]) / tiny == pytest.approx(moved.turned_s[:, axis], abs=1e-7)
        position, velocity, end = loop(START, FORCE, RATE + error)
        # The sums take a rotation for constant in a sample, hence to 1 %.
        assert (position - here[0]) / tiny == pytest.approx(moved.position_per_rate[:, axis], abs=2e-5)
        assert (velocity - here[1]) / tiny == pytest.approx(moved.velocity_per_rate[:, axis], abs=5e-4)
        turn = (end * here[2].inv()).as_rotvec() / tiny
        assert turn == pytest.approx(moved.turned_s[:, axis], abs=1e-4)
        position, velocity, _ = loop(Rotation.from_rotvec(error) * START, FORCE, RATE)
        felt = np.cross(np.eye(3)[axis], moved.felt_position_m)
        assert (position - here[0]) / tiny == pytest.approx(felt, abs=1e-6)
        felt = np.cross(np.eye(3)[axis], moved.felt_velocity_mps)
        assert (velocity - here[1]) / tiny == pytest.approx(felt, abs=1e-5)
