"""On board: the right sensors at the right times, every draw under its own name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.gnss import GnssReceiver
from advpipe.pipeline.localisation.onboard import OnBoard, OnBoardStep
from advpipe.pipeline.localisation.section import GnssSensor, ImuSensor
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.sensors import Sensors

STEP_NS = 100_000_000


@pytest.fixture(scope="module")
def poses(make_drive: Callable[[int, float], Float64]) -> Float64:
    return make_drive(0, 3)


def ride(poses: Float64, geodesy: Geodesy, sensors: Sensors, name: str = "ego") -> list[OnBoardStep]:
    board = OnBoard(name, sensors, geodesy, 0.1, 7)
    velocity_mps = (poses[1] - poses[0])[:3, 3] / 0.1
    return [board.step(5 * STEP_NS + k * STEP_NS, pose, velocity_mps) for k, pose in enumerate(poses)]


def test_samples_lie_in_the_step_that_they_end(poses: Float64, geodesy: Geodesy) -> None:
    steps = ride(poses, geodesy, Sensors())
    assert len(steps[0].measured.imu.stamps_ns) == 0  # nothing is known of the time before
    for step in steps[1:]:
        stamps_ns = step.measured.imu.stamps_ns
        assert stamps_ns[-1] == step.measured.stamp_ns
        assert (np.diff(stamps_ns) == 10_000_000).all()
        assert stamps_ns[0] == step.measured.stamp_ns - STEP_NS + 10_000_000


def test_fixes_are_the_receivers(poses: Float64, geodesy: Geodesy) -> None:
    receiver = GnssReceiver(GnssSensor(), 0.1, named_generator(7, "gnss", "ego"))
    for step, pose in zip(ride(poses, geodesy, Sensors()), poses, strict=True):
        assert step.measured.fix is not None
        assert geodesy.to_map(step.measured.fix) == pytest.approx(receiver.fix(pose[:3, 3]), abs=1e-6)


def test_fewer_fixes(poses: Float64, geodesy: Geodesy) -> None:
    steps = ride(poses, geodesy, Sensors(gnss=GnssSensor(rate_hz=2)))
    assert [k for k, step in enumerate(steps) if step.measured.fix is not None] == [0, 5, 10, 15, 20, 25]


def test_vehicles_and_uses_draw_for_themselves(poses: Float64, geodesy: Geodesy) -> None:
    ego, other = ride(poses, geodesy, Sensors()), ride(poses, geodesy, Sensors(), "other")
    rarer = ride(poses, geodesy, Sensors(gnss=GnssSensor(rate_hz=2)))
    for mine, theirs, alike in zip(ego[1:], other[1:], rarer[1:], strict=True):
        force = mine.measured.imu.specific_force_mps2
        assert (force != theirs.measured.imu.specific_force_mps2).all()
        assert (force == alike.measured.imu.specific_force_mps2).all()
        assert mine.measured.wheel == alike.measured.wheel != theirs.measured.wheel


@pytest.mark.parametrize(
    ("sensors", "step_s", "complaint"),
    [
        (Sensors(imu=ImuSensor(rate_hz=10)), 0.1, "sensors.imu.rate_hz 10 is no whole multiple"),
        (Sensors(imu=ImuSensor(rate_hz=105)), 0.1, "sensors.imu.rate_hz 105 is no whole multiple"),
        (Sensors(gnss=GnssSensor(rate_hz=20)), 0.1, "sensors.gnss.rate_hz 20 does not divide"),
        (Sensors(gnss=GnssSensor(rate_hz=3)), 0.1, "sensors.gnss.rate_hz 3 does not divide"),
    ],
)
def test_refuses_rates_that_do_not_fit(
    geodesy: Geodesy, sensors: Sensors, step_s: float, complaint: str
) -> None:
    with pytest.raises(AdvpipeError, match=complaint):
        OnBoard("ego", sensors, geodesy, step_s, 1)
    with pytest.raises(ValueError, match=complaint):
        sensors.check(step_s)


@pytest.mark.parametrize("model", [ImuSensor, GnssSensor])
@pytest.mark.parametrize("rate_hz", [0, -10, float("nan")])
def test_refuses_rates_that_are_none(model: Any, rate_hz: float) -> None:
    with pytest.raises(ValidationError, match="rate_hz"):
        model(rate_hz=rate_hz)


def test_a_scenario_file_is_refused_too() -> None:
    with pytest.raises(AdvpipeError, match=r"sensors\.imu\.rate_hz 15 is no whole multiple"):
        load_scenario("smoke", ["sensors.imu.rate_hz=15"])
    with pytest.raises(AdvpipeError, match="rate_hz"):
        load_scenario("smoke", ["sensors.gnss.rate_hz=0"])
