"""A filter run again on what a bag holds gives the recorded estimates, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.localisation import (
    estimate_message,
    initial_pose_message,
    onboard_messages,
    read_initial_pose,
    read_measurements,
)
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.onboard import OnBoard, OnBoardStep
from advpipe.pipeline.localisation.section import GnssSensor
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.message_bounds import LATEST_NS
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.scenario.sensors import Sensors

EGO = VehicleTopics("ego")
START_NS, STEP_NS, STEPS = 1_767_268_800_000_000_000, 100_000_000, 40
SENSORS = Sensors(gnss=GnssSensor(rate_hz=5))
GEODESY = Geodesy(50.1, 8.6, 100.0)


def poses() -> list[np.ndarray]:
    """12 m/s on a circle of 40 m radius, uphill."""
    angles = 0.3 * 0.1 * np.arange(STEPS)
    return [
        se3_from_yaw([40 * np.sin(angle), 40 - 40 * np.cos(angle), angle], angle, -1 / 40) for angle in angles
    ]


@pytest.fixture(scope="module")
def steps() -> list[OnBoardStep]:
    board = OnBoard("ego", SENSORS, GEODESY, 0.1, 11)
    return [
        board.step(START_NS + k * STEP_NS, pose, np.array([12.0, 0, 0.3])) for k, pose in enumerate(poses())
    ]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "clean"
    board = OnBoard("ego", SENSORS, GEODESY, 0.1, 11)
    with BagWriter(path, provenance={"kind": "clean"}) as writer:
        for k, pose in enumerate(poses()):
            step = board.step(START_NS + k * STEP_NS, pose, np.array([12.0, 0, 0.3]))
            if k == 0:
                assert board.initial is not None
                writer.write(*initial_pose_message(EGO, board.initial, START_NS))
            for stamped in onboard_messages(EGO, SENSORS.imu, step):
                writer.write(*stamped)
    return path


def test_running_it_again_gives_the_same_messages(bag: Path) -> None:
    reader = BagReader(bag)
    estimator = Estimator(SENSORS, GEODESY, read_initial_pose(reader, EGO))
    again = []
    for measured in read_measurements(reader, EGO):
        topic, message, stamp_ns = estimate_message(EGO, estimator.step(measured))
        again.append((stamp_ns, serialise(message, topic.type)))
    recorded = [(raw.log_time_ns, raw.cdr) for raw in reader.raw_messages([EGO.odometry.name])]
    assert len(recorded) == STEPS
    assert again == recorded


def test_measurements_come_back_as_they_were(bag: Path, steps: list[OnBoardStep]) -> None:
    for read, step in zip(read_measurements(BagReader(bag), EGO), steps, strict=True):
        written = step.measured
        assert (read.stamp_ns, read.wheel) == (written.stamp_ns, written.wheel)
        assert np.array_equal(read.imu.stamps_ns, written.imu.stamps_ns)
        assert np.array_equal(read.imu.specific_force_mps2, written.imu.specific_force_mps2)
        assert np.array_equal(read.imu.angular_rate_radps, written.imu.angular_rate_radps)
        assert (read.fix is None) == (written.fix is None)
        assert read.fix is None or np.array_equal(read.fix, written.fix)


def test_topics_rates_and_frames(bag: Path) -> None:
    reader = BagReader(bag)
    counts = {name: info.count for name, info in reader.topics.items()}
    assert counts == {
        "/ego/initialpose": 1,
        "/ego/imu": 10 * (STEPS - 1),
        "/ego/gnss/fix": STEPS // 2,
        "/ego/wheel/odometry": STEPS,
        "/ego/odometry": STEPS,
    }
    _, imu = list(reader.messages("/ego/imu"))[37]
    assert (build.stamp_ns(imu) - START_NS) == 380_000_000
    assert imu.header.frame_id == "ego/imu"
    assert imu.orientation_covariance[0] == -1
    assert imu.linear_acceleration.z == pytest.approx(9.8, abs=0.5)
    assert imu.linear_acceleration.y == pytest.approx(12 * 0.3, abs=0.5)  # towards the centre, on the left
    assert imu.linear_acceleration_covariance[8] == pytest.approx((0.0019 * 10) ** 2)
    _, wheel = list(reader.messages("/ego/wheel/odometry"))[-1]
    assert (wheel.header.frame_id, wheel.child_frame_id) == ("ego/odom", "ego/base_link")
    assert wheel.pose.pose.position.x == pytest.approx(40 * np.sin(0.03 * (STEPS - 1)), abs=1.5)
    _, odometry = list(reader.messages("/ego/odometry"))[-1]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "ego/base_link")
    assert odometry.twist.twist.linear.x == pytest.approx(12, abs=0.5)
    assert 0.1 < odometry.pose.covariance[0] < 4


def test_a_receiver_that_is_jammed(tmp_path: Path, steps: list[OnBoardStep]) -> None:
    with BagWriter(tmp_path / "jammed", provenance={}) as writer:
        for k, step in enumerate(steps[:6]):
            stamp_ns = step.measured.stamp_ns
            place = (np.nan, np.nan, np.nan) if k == 4 else (50.1, 8.6, 100.0)
            fix = build.nav_sat_fix(stamp_ns, *place, is_fix=k != 2)
            writer.write(EGO.gnss_fix, fix, stamp_ns)
            writer.write(*estimate_message(EGO, step.estimate))
    measured = list(read_measurements(BagReader(tmp_path / "jammed"), EGO))
    assert [m.fix is None for m in measured] == [False, False, True, False, True, False]
    assert all(m.wheel is None and len(m.imu.stamps_ns) == 0 for m in measured)


def test_refuses_a_bag_without_a_filter(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "empty", provenance={}) as writer:
        writer.write(EGO.gnss_fix, build.nav_sat_fix(5, 1, 2, 3), 5)
    reader = BagReader(tmp_path / "empty")
    with pytest.raises(AdvpipeError, match="no topic /ego/odometry"):
        next(read_measurements(reader, EGO))
    with pytest.raises(AdvpipeError, match="no topic /ego/initialpose"):
        read_initial_pose(reader, EGO)


def test_refuses_an_estimate_after_the_last_time_stamp(tmp_path: Path, steps: list[OnBoardStep]) -> None:
    with BagWriter(tmp_path / "late", provenance={}) as writer:
        topic, message, _ = estimate_message(EGO, steps[0].estimate)
        writer.write(topic, message, LATEST_NS + 1)
    with pytest.raises(AdvpipeError, match=r"/ego/odometry has a message at .* after January 2038"):
        next(read_measurements(BagReader(tmp_path / "late"), EGO))
