"""What localisation on board puts into a bag, and what its filter reads back from one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.measurements import ImuSamples, InitialPose, Measurements, WheelTwist
from advpipe.pipeline.localisation.onboard import OnBoardStep
from advpipe.pipeline.localisation.section import ImuSensor
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.message_bounds import LATEST_NS
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics

Stamped = tuple[Topic, Any, int]
"""A topic, a message for it, and its stamp in nanoseconds."""


def initial_pose_message(topics: VehicleTopics, initial: InitialPose, stamp_ns: int) -> Stamped:
    """Where the filter starts, as the topic `initialpose` of ROS has it."""
    message = build.initial_pose(
        stamp_ns, initial.position_m, initial.xyzw, initial.covariance, frame_id=MAP_FRAME
    )
    return topics.initial_pose, message, stamp_ns


def onboard_messages(topics: VehicleTopics, sensor: ImuSensor, step: OnBoardStep) -> Iterator[Stamped]:
    """All of one step in time order: IMU samples, fix, wheel odometry, estimate.

    Floating-point numbers go into messages as they are, so that a filter fed from the bag sees what the
    one on board saw, to the bit.
    """
    measured, stamp_ns = step.measured, step.measured.stamp_ns
    yield from imu_messages(topics, sensor, measured.imu)
    if measured.fix is not None:
        fix = build.nav_sat_fix(
            stamp_ns, *measured.fix, std_m=step.fix_stddev_m.tolist(), frame_id=topics.base_frame
        )
        yield topics.gnss_fix, fix, stamp_ns
    if measured.wheel is not None:
        odometry = build.odometry(
            stamp_ns,
            step.odometry.odom_SE3_base,
            (measured.wheel.speed_mps, 0.0, 0.0),
            (0.0, 0.0, measured.wheel.turn_rate_radps),
            frame_id=topics.odom_frame,
            child_frame_id=topics.base_frame,
            pose_covariance=step.odometry.pose_covariance,
            twist_covariance=step.odometry.twist_covariance,
        )
        yield topics.wheel_odometry, odometry, stamp_ns
    yield estimate_message(topics, step.estimate)


def imu_messages(topics: VehicleTopics, sensor: ImuSensor, samples: ImuSamples) -> Iterator[Stamped]:
    """One message a sample, at its own stamp; the standard deviations are those of white noise."""
    root_rate = float(np.sqrt(sensor.rate_hz))
    for stamp, force, rate in zip(
        samples.stamps_ns.tolist(), samples.specific_force_mps2, samples.angular_rate_radps, strict=True
    ):
        message = build.imu(
            stamp,
            force,
            rate,
            force_stddev_mps2=root_rate * sensor.accelerometer_noise_density,
            rate_stddev_radps=root_rate * sensor.gyroscope_noise_density,
            frame_id=topics.imu_frame,
        )
        yield topics.imu, message, stamp


def estimate_message(topics: VehicleTopics, estimate: Estimate) -> Stamped:
    """The estimate in the map, with its covariances."""
    message = build.odometry(
        estimate.stamp_ns,
        estimate.map_SE3_base,
        estimate.base_velocity_mps,
        estimate.base_turn_rate_radps,
        frame_id=MAP_FRAME,
        child_frame_id=topics.base_frame,
        pose_covariance=estimate.pose_covariance,
        twist_covariance=estimate.twist_covariance,
    )
    return topics.odometry, message, estimate.stamp_ns


def read_initial_pose(reader: BagReader, topics: VehicleTopics) -> InitialPose:
    """Where the filter of a recorded vehicle started. Raises AdvpipeError for a bag that does not say."""
    for _, message in reader.messages(topics.initial_pose.name):
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        return InitialPose(
            np.array([place.x, place.y, place.z]),
            np.array([turn.x, turn.y, turn.z, turn.w]),
            np.array(message.pose.covariance, dtype=np.float64).reshape(6, 6),
        )
    raise AdvpipeError(f"{reader.path}: {topics.initial_pose.name} is empty; record it again")


def read_measurements(
    reader: BagReader, topics: VehicleTopics, last_ns: int | None = None
) -> Iterator[Measurements]:
    """What the filter of a recorded vehicle saw, for each of its recorded estimates up to `last_ns`.

    A message counts for the first estimate at or after its log time, the time at which it arrived; of fixes
    and wheel odometry the last one. A fix without a place is none. Raises AdvpipeError for a bag without
    estimates, for two at one time, and for one after `LATEST_NS`.
    """
    if topics.odometry.name not in reader.topics:
        raise UsageError(
            f"{reader.path} has no topic {topics.odometry.name}, so there is no filter to run again"
        )
    stamps_ns = reader.log_times_ns(topics.odometry.name)
    if last_ns is not None:
        stamps_ns = stamps_ns[stamps_ns <= last_ns]
    (again,) = np.nonzero(np.diff(stamps_ns) <= 0)
    if len(again):
        raise AdvpipeError(
            f"{reader.path}: {topics.odometry.name} has two messages at {stamps_ns[again[0]]} ns; record it "
            "again"
        )
    if stamps_ns.max(initial=0) > LATEST_NS:
        raise AdvpipeError(
            f"{reader.path}: {topics.odometry.name} has a message at {stamps_ns[-1]} ns, after January 2038, "
            "where ROS time stamps end; record it again"
        )
    names = [topics.imu.name, topics.gnss_fix.name, topics.wheel_odometry.name]
    found = reader.raw_messages(names, last_ns=last_ns)
    arrivals = ((raw.log_time_ns, raw.topic.name, reader.decode(raw)) for raw in found)
    arrival = next(arrivals, None)
    for stamp_ns in stamps_ns.tolist():
        samples: list[Any] = []
        wheel: WheelTwist | None = None
        fix: Float64 | None = None
        while arrival is not None and arrival[0] <= stamp_ns:
            _, name, message = arrival
            if name == topics.imu.name:
                samples.append(message)
            elif name == topics.wheel_odometry.name:
                twist = message.twist.twist
                wheel = WheelTwist(twist.linear.x, twist.angular.z)
            else:
                fix = _fix(message)
            arrival = next(arrivals, None)
        yield Measurements(stamp_ns, _imu_samples(samples), wheel, fix)


def _fix(message: Any) -> Float64 | None:
    place = np.array([message.latitude, message.longitude, message.altitude])
    return place if message.status.status >= 0 and np.isfinite(place).all() else None


def _imu_samples(samples: list[Any]) -> ImuSamples:
    forces = [[m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z] for m in samples]
    rates = [[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in samples]
    return ImuSamples(
        np.array([build.stamp_ns(message) for message in samples], dtype=np.int64),
        np.array(forces, dtype=np.float64).reshape(-1, 3),
        np.array(rates, dtype=np.float64).reshape(-1, 3),
    )
