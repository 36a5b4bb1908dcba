"""The true motion: an inertial navigation without errors arrives at the very poses it was made from."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.localisation.motion import Motion, MotionStep

STEP_S = 0.1


def motion(poses: Float64, samples: int = 10) -> list[MotionStep]:
    moving = Motion(STEP_S, samples)
    return [moving.advance(pose, (poses[1] - poses[0])[:3, 3] / STEP_S) for pose in poses]


def navigated(steps: list[MotionStep]) -> list[tuple[Float64, Float64, Float64]]:
    """Position, velocity and rotation at the end of each step: a plain loop over the IMU's samples."""
    position, velocity = steps[0].map_SE3_base[:3, 3].copy(), steps[0].velocity_mps.copy()
    turn = Rotation.from_matrix(steps[0].map_SE3_base[:3, :3])
    arrived = [(position, velocity, turn.as_matrix())]
    for step in steps[1:]:
        short_s = STEP_S / len(step.specific_force_mps2)
        half = Rotation.from_rotvec(step.turn_rate_radps * short_s / 2)
        for force in step.specific_force_mps2:
            acceleration = (turn * half).apply(force) - [0, 0, 9.80665]
            position = position + velocity * short_s + acceleration * short_s**2 / 2
            velocity = velocity + acceleration * short_s
            turn = turn * half * half
        arrived.append((position, velocity, turn.as_matrix()))
    return arrived


@pytest.mark.parametrize("samples", [2, 10, 40])
def test_strapdown_returns_to_the_truth(make_drive: Callable[[int, float], Float64], samples: int) -> None:
    steps = motion(make_drive(0, 60), samples)
    for step, (position, velocity, turned) in zip(steps, navigated(steps), strict=True):
        assert position == pytest.approx(step.map_SE3_base[:3, 3], abs=1e-8)
        assert velocity == pytest.approx(step.velocity_mps, abs=1e-9)
        assert turned == pytest.approx(step.map_SE3_base[:3, :3], abs=1e-11)


def test_a_jump_is_violent_but_ends_where_it_should() -> None:
    poses = np.array([se3_from_yaw([x, 3.0 * (x > 4), 0], 0.5 * (x > 4)) for x in np.arange(0, 10, 1.0)])
    steps = motion(poses)
    assert max(np.abs(step.specific_force_mps2).max(initial=0) for step in steps) > 300
    for step, (position, *_) in zip(steps, navigated(steps), strict=True):
        assert position == pytest.approx(step.map_SE3_base[:3, 3], abs=1e-9)
    assert steps[-1].velocity_mps == pytest.approx([10, 0, 0], abs=1e-9)  # and nothing rings after it


def test_a_circle_to_the_left() -> None:
    """10 m/s on a radius of 20 m: 0.5 rad/s, and 5 m/s² towards the centre, on the left."""
    angles = 0.5 * STEP_S * np.arange(60)
    poses = np.array([se3_from_yaw([20 * np.sin(a), -20 * np.cos(a), 0], a) for a in angles])
    for step in motion(poses)[3:]:
        assert step.turn_rate_radps == pytest.approx([0, 0, 0.5])
        assert step.base_velocity_mps == pytest.approx([10, 0, 0], abs=0.05)
        assert step.specific_force_mps2.mean(axis=0) == pytest.approx([0, 5, 9.80665], abs=0.05)


def test_starting_from_rest() -> None:
    """2 m/s² from the fourth pose on: felt forwards, exactly once the change is past."""
    t = np.clip(STEP_S * (np.arange(40) - 3), 0, None)
    steps = motion(np.array([se3_from_yaw([s * s, 0, 0], 0) for s in t]))
    assert steps[2].specific_force_mps2 == pytest.approx(np.tile([0, 0, 9.80665], (10, 1)))
    for before, step in list(pairwise(steps))[6:]:
        assert step.specific_force_mps2 == pytest.approx(np.tile([2, 0, 9.80665], (10, 1)), abs=1e-9)
        assert (step.velocity_mps - before.velocity_mps)[0] == pytest.approx(0.2)


def test_standing_on_a_slope() -> None:
    """Nose down by 0.1 rad, the vehicle's x axis points below the horizon, and what holds it up points up."""
    steps = motion(np.array([se3_from_yaw([1, 2, 3], 0.7, pitch_rad=0.1)] * 3))
    expected = 9.80665 * np.array([-np.sin(0.1), 0, np.cos(0.1)])
    assert steps[0].specific_force_mps2.shape == (0, 3)
    assert steps[-1].specific_force_mps2 == pytest.approx(np.tile(expected, (10, 1)))
