"""What the vehicle observed, a tenth of a second at a time, in the order in which it arrived."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64, se3_from_quaternion
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import StampedCloud
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.stages.investigate.evidence_topics import EvidenceKind, EvidenceTopics

PERIOD_NS = 100_000_000
"""Cues judge what arrived in such a period together."""


class ObservedFix(NamedTuple):
    """A GNSS fix: latitude and longitude in degrees, altitude in metres (3,)."""

    time_ns: int
    geographic: Float64


class ObservedTwist(NamedTuple):
    """What the wheels measured."""

    time_ns: int
    speed_mps: float
    turn_rate_radps: float


class ObservedInertia(NamedTuple):
    """An IMU's sample, both (3,)."""

    time_ns: int
    specific_force_mps2: Float64
    angular_rate_radps: Float64


class ObservedPose(NamedTuple):
    """The vehicle's own estimate (4, 4). yaw_stddev_rad: of its heading; place_stddev_m: of its place along
    the axis that is less sure; both 0 where they are not stated."""

    time_ns: int
    map_SE3_base: Float64
    yaw_stddev_rad: float = 0.0
    place_stddev_m: float = 0.0


class ObservedPacket(NamedTuple):
    """A received packet; power and SINR are NaN where they are not recorded."""

    arrival_ns: int
    data: bytes
    power_dbm: float = math.nan
    sinr_db: float = math.nan


@dataclass(frozen=True)
class LidarScan:
    """A cloud, which is unpacked when a cue first asks for it."""

    topic: str
    time_ns: int
    read: Callable[[], StampedCloud] = field(repr=False)

    @cached_property
    def scan(self) -> StampedCloud:
        """The cloud. Raises AdvpipeError for a damaged one."""
        return self.read()


@dataclass
class Observations:
    """All that arrived in one period, which ends at `time_ns`."""

    time_ns: int
    scans: list[LidarScan] = field(default_factory=list)
    fixes: list[ObservedFix] = field(default_factory=list)
    twists: list[ObservedTwist] = field(default_factory=list)
    inertia: list[ObservedInertia] = field(default_factory=list)
    poses: list[ObservedPose] = field(default_factory=list)
    packets: list[ObservedPacket] = field(default_factory=list)


def read_observations(reader: BagReader, topics: EvidenceTopics) -> Iterator[Observations]:
    """Yield the periods of a bag that hold anything, one at a time; the first ends where the bag begins."""
    current: Observations | None = None
    first_ns, waiting = 0, _WaitingPackets()
    for raw in reader.raw_messages(sorted(topics.kinds)):
        if current is None:
            first_ns = raw.log_time_ns
            current = Observations(first_ns)
        if raw.log_time_ns > current.time_ns:
            current.packets = waiting.taken()
            yield current
            periods = -(-(raw.log_time_ns - first_ns) // PERIOD_NS)
            current = Observations(first_ns + periods * PERIOD_NS)
        _take(reader, topics, raw, current, waiting)
    if current is not None:
        current.packets = waiting.taken()
        yield current


class _WaitingPackets:
    """Joins packets with their power by their stamps, as they are written side by side."""

    def __init__(self) -> None:
        self._packets: dict[tuple[int, int], ObservedPacket] = {}
        self._counts: tuple[Counter[int], Counter[int]] = (Counter(), Counter())

    def add(self, stamp_ns: int, data: bytes) -> None:
        self._packets[stamp_ns, self._counts[0][stamp_ns]] = ObservedPacket(stamp_ns, data)
        self._counts[0][stamp_ns] += 1

    def add_power(self, stamp_ns: int, power_dbm: float, sinr_db: float) -> None:
        key = (stamp_ns, self._counts[1][stamp_ns])
        self._counts[1][stamp_ns] += 1
        if key in self._packets:
            self._packets[key] = self._packets[key]._replace(power_dbm=power_dbm, sinr_db=sinr_db)

    def taken(self) -> list[ObservedPacket]:
        """Those of the period, by arrival; the next period starts empty."""
        found = [self._packets[key] for key in sorted(self._packets)]
        self._packets.clear()
        for counts in self._counts:
            counts.clear()
        return found


def _take(
    reader: BagReader,
    topics: EvidenceTopics,
    raw: RawMessage,
    current: Observations,
    waiting: _WaitingPackets,
) -> None:
    kind, time_ns = topics.kinds[raw.topic.name], raw.log_time_ns
    if kind is EvidenceKind.CLOUDS:
        current.scans.append(LidarScan(raw.topic.name, time_ns, lambda: reader.cloud(raw)))
        return
    if kind not in _TAKEN:
        return
    message = reader.decode(raw)
    if kind is EvidenceKind.MESSAGES:
        waiting.add(build.stamp_ns(message), bytes(message.data))
    elif kind is EvidenceKind.RECEPTIONS:
        waiting.add_power(build.stamp_ns(message), float(message.power_dbm), float(message.sinr_db))
    elif kind is EvidenceKind.TRANSFORMS:
        if not topics.has(EvidenceKind.ESTIMATE):
            current.poses += _pose_in(message, topics.vehicle, time_ns)
    else:
        _TAKEN[kind](current, message, time_ns)


def _take_fix(current: Observations, message: Any, time_ns: int) -> None:
    place = np.array([message.latitude, message.longitude, message.altitude])
    if message.status.status >= 0 and np.isfinite(place).all() and abs(place[0]) < 90:
        current.fixes.append(ObservedFix(time_ns, place))


def _take_twist(current: Observations, message: Any, time_ns: int) -> None:
    twist = message.twist.twist
    current.twists.append(ObservedTwist(time_ns, float(twist.linear.x), float(twist.angular.z)))


def _take_inertia(current: Observations, message: Any, time_ns: int) -> None:
    force, rate = message.linear_acceleration, message.angular_velocity
    sample = np.array([force.x, force.y, force.z]), np.array([rate.x, rate.y, rate.z])
    current.inertia.append(ObservedInertia(build.stamp_ns(message), *sample))


def _take_pose(current: Observations, message: Any, time_ns: int) -> None:
    if message.header.frame_id == MAP_FRAME:
        variance = message.pose.covariance
        yaw_rad2, place_m2 = max(float(variance[35]), 0.0), max(float(variance[0]), float(variance[7]), 0.0)
        current.poses.append(
            ObservedPose(
                time_ns, build.se3_from_pose(message.pose.pose), math.sqrt(yaw_rad2), math.sqrt(place_m2)
            )
        )


def _ignore(current: Observations, message: Any, time_ns: int) -> None:
    """A kind that `_take` handles itself."""


_TAKEN: Mapping[EvidenceKind, Callable[[Observations, Any, int], None]] = {
    EvidenceKind.FIXES: _take_fix,
    EvidenceKind.WHEELS: _take_twist,
    EvidenceKind.IMU: _take_inertia,
    EvidenceKind.ESTIMATE: _take_pose,
    EvidenceKind.MESSAGES: _ignore,
    EvidenceKind.RECEPTIONS: _ignore,
    EvidenceKind.TRANSFORMS: _ignore,
}


def _pose_in(message: Any, vehicle: str, time_ns: int) -> list[ObservedPose]:
    """The vehicle's pose in a message of /tf."""
    frames = (VehicleTopics(vehicle).base_frame, "base_link")
    for link in message.transforms:
        if link.header.frame_id == MAP_FRAME and link.child_frame_id in frames:
            turn, place = link.transform.rotation, link.transform.translation
            pose = se3_from_quaternion([turn.x, turn.y, turn.z, turn.w], [place.x, place.y, place.z])
            return [ObservedPose(time_ns, pose)]
    return []
