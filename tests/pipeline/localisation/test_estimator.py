"""The on-board filter: errors that fit its covariance, better than the fixes, and firm against bad input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.measurements import ImuSamples, Measurements
from advpipe.pipeline.localisation.onboard import OnBoard, OnBoardStep
from advpipe.pipeline.localisation.rotations import rotation_vector
from advpipe.pipeline.localisation.section import (
    GnssSensor,
    ImuSensor,
    LocalisationFilter,
    WheelOdometrySensor,
)
from advpipe.pipeline.scenario.sensors import Sensors

STEP_NS = 100_000_000
RUNS = 30
CHI2_95 = {1: (16.79, 46.98), 2: (40.48, 83.30), 3: (65.65, 118.14)}
"""Between which sums over 30 runs lie in 95 % of all cases: chi-square with 30, 60 and 90 degrees."""

MakeDrive = Callable[[int, float], Float64]


@dataclass(frozen=True)
class Run:
    """One drive on board; `initial` is what the filter started from."""

    board: OnBoard
    poses: Float64
    steps: list[OnBoardStep]

    @property
    def measured(self) -> list[Measurements]:
        return [step.measured for step in self.steps]


def ride(poses: Float64, geodesy: Geodesy, seed: int, sensors: Sensors | None = None) -> Run:
    board = OnBoard("ego", sensors or Sensors(), geodesy, 0.1, seed)
    velocity_mps = (poses[1] - poses[0])[:3, 3] / 0.1
    steps = [board.step(k * STEP_NS, pose, velocity_mps) for k, pose in enumerate(poses)]
    return Run(board, poses, steps)


def again(
    run: Run, geodesy: Geodesy, measured: Sequence[Measurements], sensors: Sensors | None = None
) -> list[Estimate]:
    """The filter alone, on measurements."""
    assert run.board.initial is not None
    estimator = Estimator(sensors or Sensors(), geodesy, run.board.initial)
    return [estimator.step(each) for each in measured]


def pose_errors(poses: Float64, estimates: Sequence[Estimate]) -> Float64:
    """Errors (K, 6) of the pose along the map's axes."""
    return np.array(
        [
            [
                *(pose - estimate.map_SE3_base)[:3, 3],
                *rotation_vector(pose[:3, :3] @ estimate.map_SE3_base[:3, :3].T),
            ]
            for pose, estimate in zip(poses, estimates, strict=True)
        ]
    )


def nees(errors: Float64, estimates: Sequence[Estimate], part: slice) -> Float64:
    """Normalised estimation errors squared (K,) of a part of the pose (Bar-Shalom, section 5.4)."""
    covariance = np.array([estimate.pose_covariance[part, part] for estimate in estimates])
    solved = np.linalg.solve(covariance, errors[:, part, None])[..., 0]
    return np.asarray(np.sum(errors[:, part] * solved, axis=1))


@pytest.fixture(scope="module")
def runs(make_drive: MakeDrive, geodesy: Geodesy) -> list[Run]:
    return [ride(make_drive(seed, 30), geodesy, seed) for seed in range(RUNS)]


@pytest.mark.parametrize(("part", "freedom"), [(slice(0, 3), 3), (slice(3, 5), 2), (slice(5, 6), 1)])
def test_errors_fit_the_covariance(runs: list[Run], part: slice, freedom: int) -> None:
    """Position, tilt, yaw: neither overconfident nor underconfident at 95 %.

    The sum over the runs, averaged over the drive: errors of one drive hang together, so that each run
    counts once.
    """
    estimates = [[step.estimate for step in run.steps] for run in runs]
    values = np.array([nees(pose_errors(r.poses, e), e, part) for r, e in zip(runs, estimates, strict=True)])
    low, high = CHI2_95[freedom]
    assert low < values.mean(axis=1).sum() < high
    inside = [low < total < high for total in values.sum(axis=0)[::25]]
    assert np.mean(inside) >= 0.75


def test_velocities_fit_their_covariance(runs: list[Run]) -> None:
    means = []
    for run in runs:
        squares = []
        for step in run.steps:
            error = step.truth.base_velocity_mps - step.estimate.base_velocity_mps
            squares.append(error @ np.linalg.solve(step.estimate.twist_covariance[:3, :3], error))
        means.append(np.mean(squares))
    # Slides are told as white noise that is as strong at low frequencies: somewhat too much at high ones.
    assert 1.5 < np.mean(means) < CHI2_95[3][1] / RUNS


def test_innovations_are_as_expected(runs: list[Run]) -> None:
    values = [step.estimate.innovation.nis for run in runs for step in run.steps if step.estimate.innovation]
    assert len(values) == RUNS * 300
    assert np.mean(values) == pytest.approx(3.0, abs=0.12)  # 3 standard deviations of 9000 chi-square ones
    assert np.mean(np.array(values) > 7.815) == pytest.approx(0.05, abs=0.01)


def test_a_filter_that_trusts_its_fixes_too_much_would_be_found_out(
    runs: list[Run], geodesy: Geodesy
) -> None:
    trusting = Sensors(gnss=GnssSensor(drift_stddev_m=0.2))
    sums = 0.0
    for run in runs[:10]:
        estimates = again(run, geodesy, run.measured, trusting)
        sums += nees(pose_errors(run.poses, estimates), estimates, slice(0, 3)).mean()
    assert sums / 10 > 2 * CHI2_95[3][1] / RUNS


def test_better_than_the_fixes(runs: list[Run], geodesy: Geodesy) -> None:
    estimated, raw = [], []
    for run in runs:
        fixes = np.array([geodesy.to_map(m.fix) for m in run.measured if m.fix is not None])
        raw.append(np.mean(np.sum((fixes - run.poses[:, :3, 3]) ** 2, axis=1)))
        errors = pose_errors(run.poses, [step.estimate for step in run.steps])
        estimated.append(np.mean(np.sum(errors[:, :3] ** 2, axis=1)))
    assert np.sqrt(np.mean(estimated)) < 0.9 * np.sqrt(np.mean(raw))
    # Where the offset of the fixes does not wander, nearly all of their noise goes.
    white = Sensors(gnss=GnssSensor(white_stddev_m=1.0, drift_stddev_m=0.0))
    run = ride(runs[0].poses, geodesy, 5, white)
    errors = pose_errors(run.poses, [step.estimate for step in run.steps])[100:]
    assert np.sqrt(np.mean(errors[:, :2] ** 2)) < 0.35


def test_ten_seconds_without_fixes(runs: list[Run], geodesy: Geodesy) -> None:
    """Errors grow, and so does what the filter says of them: 3 standard deviations hold in 98 %."""
    before, after, ratios = [], [], []
    for run in runs[:20]:
        jammed = [
            replace(measured, fix=None) if 100 <= k < 200 else measured
            for k, measured in enumerate(run.measured[:220])
        ]
        estimates = again(run, geodesy, jammed)
        assert [estimate.innovation is None for estimate in estimates].count(True) == 100
        errors = pose_errors(run.poses[:220], estimates)
        stddev = np.array([np.sqrt(np.diag(estimate.pose_covariance)[:3]) for estimate in estimates])
        assert (stddev[199, :2] > stddev[99, :2]).all()
        ratios.append(np.abs(errors[100:200, :3]) / stddev[100:200])
        before.append(np.sum(errors[99, :3] ** 2))
        after.append(np.sum(errors[199, :3] ** 2))
    assert np.mean(after) > np.mean(before)
    assert np.mean(np.array(ratios) < 3) > 0.98
    assert np.max(ratios) > 1


def test_the_same_measurements_give_the_same_bits(runs: list[Run], geodesy: Geodesy) -> None:
    for recorded, estimate in zip(runs[0].steps, again(runs[0], geodesy, runs[0].measured), strict=True):
        assert estimate.map_SE3_base.tobytes() == recorded.estimate.map_SE3_base.tobytes()
        assert estimate.pose_covariance.tobytes() == recorded.estimate.pose_covariance.tobytes()
        assert estimate.twist_covariance.tobytes() == recorded.estimate.twist_covariance.tobytes()


def test_without_noise_it_follows_the_truth(make_drive: MakeDrive, geodesy: Geodesy) -> None:
    sensors = Sensors(
        gnss=GnssSensor(white_stddev_m=0, drift_stddev_m=0),
        imu=ImuSensor(
            accelerometer_noise_density=0,
            gyroscope_noise_density=0,
            accelerometer_bias_stddev_mps2=0,
            gyroscope_bias_stddev_radps=0,
        ),
        wheel_odometry=WheelOdometrySensor(speed_white_stddev_mps=0, speed_scale_stddev=0),
    )
    run = ride(make_drive(1, 60), geodesy, 1, sensors)
    errors = np.abs(pose_errors(run.poses, [step.estimate for step in run.steps]))
    assert errors[-1, :3].max() < 0.01
    assert errors[-1, 5] < np.deg2rad(0.1)


def spoofed(run: Run, geodesy: Geodesy, by_m: Sequence[float]) -> list[Measurements]:
    """The first 150 steps; the last fix is moved."""
    measured = run.measured[:150]
    assert measured[-1].fix is not None
    moved = geodesy.to_geographic(geodesy.to_map(measured[-1].fix) + by_m)
    return [*measured[:-1], replace(measured[-1], fix=moved)]


def test_the_gate_drops_a_fix_that_jumps(runs: list[Run], geodesy: Geodesy) -> None:
    gated = Sensors(localisation=LocalisationFilter(gate_probability=0.9999))
    measured = spoofed(runs[0], geodesy, (30.0, 0.0, 0.0))
    open_gate, closed = again(runs[0], geodesy, measured)[-1], again(runs[0], geodesy, measured, gated)[-1]
    assert open_gate.innovation is not None
    assert closed.innovation is not None
    assert (open_gate.innovation.accepted, closed.innovation.accepted) == (True, False)
    assert closed.innovation.nis > 1000
    assert closed.innovation.residual_m[0] == pytest.approx(30, abs=2)
    before = again(runs[0], geodesy, [*measured[:-1], replace(measured[-1], fix=None)])[-1]
    assert closed.map_SE3_base.tobytes() == before.map_SE3_base.tobytes()
    assert (open_gate.map_SE3_base - before.map_SE3_base)[0, 3] > 0.5


def test_missing_samples_cost_certainty_not_consistency(runs: list[Run], geodesy: Geodesy) -> None:
    none = ImuSamples(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    measured = [
        replace(m, imu=none) if 100 <= k < 103 else replace(m, wheel=None) if k % 7 == 0 else m
        for k, m in enumerate(runs[2].measured[:200])
    ]
    estimates = again(runs[2], geodesy, measured)
    errors = pose_errors(runs[2].poses[:200], estimates)
    yaw_stddev = np.sqrt([estimate.pose_covariance[5, 5] for estimate in estimates])
    assert yaw_stddev[102] > 2 * yaw_stddev[99]
    assert np.mean(np.abs(errors[100:, 5]) < 3 * yaw_stddev[100:]) > 0.95


def test_a_sensor_at_its_end_stop_is_not_believed(make_drive: MakeDrive, geodesy: Geodesy) -> None:
    """The vehicle jumps 3 m sideways in one step, which no accelerometer can follow."""
    poses = make_drive(3, 30).copy()
    poses[150:, :2, 3] += [2.0, 2.2]
    run = ride(poses, geodesy, 3)
    assert max(np.abs(m.imu.specific_force_mps2).max(initial=0) for m in run.measured) == 235.0
    errors = pose_errors(poses, [step.estimate for step in run.steps])
    assert np.abs(errors[-1, :2]).max() < 4
    stddev = np.sqrt(np.array([np.diag(step.estimate.pose_covariance) for step in run.steps]))
    assert np.mean(np.abs(errors[150:]) < 3 * stddev[150:]) > 0.95


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"fix": np.array([np.nan, 11.0, 500.0])}, "fix .* is not finite"),
        ({"stamp_ns": 5}, "do not ascend"),
        ({"stamp_ns": 1 << 62}, "the estimate has diverged"),
    ],
)
def test_refuses(runs: list[Run], geodesy: Geodesy, change: dict[str, object], complaint: str) -> None:
    measured = runs[0].measured[:3]
    with pytest.raises(AdvpipeError, match=complaint):
        again(runs[0], geodesy, [*measured[:2], replace(measured[2], **change)])  # type: ignore[arg-type]
