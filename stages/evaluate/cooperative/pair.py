"""Two vehicles with LiDARs: their clouds at the same instants, and the poses that each bag reports."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import Frame, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.topics import TF_STATIC, VehicleTopics

MARGIN_NS = 10**9
"""Clouds of one instant are logged within so much of each other."""

Poses = dict[int, Float64]
"""map_SE3_base by stamp in nanoseconds."""


@dataclass(frozen=True)
class Pair:
    """The topics of one LiDAR each: of the vehicle that fuses, and of the one that shares."""

    own: VehicleTopics
    other: VehicleTopics


@dataclass(frozen=True)
class SharedFrame:
    """One instant. own: the fusing vehicle's cloud and its truth. other: the shared cloud."""

    own: Frame
    other: Cloud


def find_pair(reader: BagReader) -> Pair | None:
    """The first two vehicles with clouds and an estimate, `ego` first; None where there are fewer."""
    found: dict[str, VehicleTopics] = {}
    for name in lidar_topics(reader):
        vehicle, _, rest = name.strip("/").partition("/")
        topics = VehicleTopics(vehicle, rest.removesuffix("/points"))
        if topics.odometry.name in reader.topics and topics.true_odometry.name in reader.topics:
            found.setdefault(vehicle, topics)
    first = sorted(found, key=lambda vehicle: (vehicle != "ego", vehicle))[:2]
    return Pair(found[first[0]], found[first[1]]) if len(first) == 2 else None


def shared_frames(reader: BagReader, pair: Pair, chosen: FrameSlice) -> Iterator[SharedFrame]:
    """Those of the chosen clouds of the fusing vehicle at whose stamp the other has one, too."""
    times_ns = reader.log_times_ns(pair.own.lidar_points.name)
    indices = chosen.indices(len(times_ns))
    first_ns, last_ns = int(times_ns[indices[0]]) - MARGIN_NS, int(times_ns[indices[-1]]) + MARGIN_NS
    clouds = reader.raw_messages([pair.other.lidar_points.name], first_ns, last_ns)
    waiting = next(clouds, None)
    for frame in read_frames(reader.path, chosen, lidar_topic=pair.own.lidar_points.name):
        while waiting is not None and reader.cloud(waiting).stamp_ns < frame.stamp_ns:
            waiting = next(clouds, None)
        if waiting is None:
            return
        stamped = reader.cloud(waiting)
        if stamped.stamp_ns == frame.stamp_ns:
            yield SharedFrame(frame, stamped.cloud)


def poses(reader: BagReader, topic: str, last_ns: int | None = None) -> Poses:
    """Of an odometry topic, up to `last_ns`."""
    return {
        build.stamp_ns(message): build.se3_from_pose(message.pose.pose)
        for _, message in reader.messages(topic, last_ns)
    }


class Alignment:
    """`own_SE3_other` between the two LiDARs, through the poses that a bag reports of their vehicles."""

    def __init__(self, reader: BagReader, pair: Pair, *, true: bool = False) -> None:
        self._reader = reader
        mounted = mounted_sensors(reader)
        self._ends: list[tuple[Poses, Float64]] = []
        for topics in (pair.own, pair.other):
            reported = topics.true_odometry if true else topics.odometry
            base_SE3_lidar = mounted.get((topics.base_frame, topics.lidar_frame))
            if base_SE3_lidar is None or reported.name not in reader.topics:
                raise AdvpipeError(
                    f"{reader.path}: {TF_STATIC.name} and {reported.name} do not tell where "
                    f"{topics.lidar_frame} is; record it again"
                )
            self._ends.append((poses(reader, reported.name), base_SE3_lidar))

    def changed_ns(self, other: Alignment) -> list[int]:
        """Stamps at which either vehicle's pose is not what the other bag reports."""
        return [
            stamp_ns
            for (own, _), (others, _) in zip(self._ends, other._ends, strict=True)
            for stamp_ns, pose in own.items()
            if stamp_ns not in others or not np.array_equal(pose, others[stamp_ns])
        ]

    def at(self, stamp_ns: int) -> Float64:
        """The transform (4, 4) at a stamp; raises AdvpipeError where a pose is missing."""
        own, other = self._map_SE3_lidars(stamp_ns)
        aligned: Float64 = invert(own) @ other
        return aligned

    def own_SE3_map(self, stamp_ns: int) -> Float64:
        """From the map to the first LiDAR, likewise."""
        return invert(self._map_SE3_lidars(stamp_ns)[0])

    def _map_SE3_lidars(self, stamp_ns: int) -> list[Float64]:
        map_SE3_lidars = []
        for reported, base_SE3_lidar in self._ends:
            if stamp_ns not in reported:
                raise AdvpipeError(
                    f"{self._reader.path} reports no pose at {stamp_ns} ns, when it has clouds"
                )
            map_SE3_lidars.append(reported[stamp_ns] @ base_SE3_lidar)
        return map_SE3_lidars


def misalignment_m(aligned: Float64, true: Float64) -> float:
    """How far apart two alignments put the other vehicle's sensor."""
    return float(np.linalg.norm(aligned[:3, 3] - true[:3, 3]))


def misalignment_deg(aligned: Float64, true: Float64) -> float:
    """The angle in space between two alignments of the other vehicle's sensor, 0 to 180."""
    half_sine = np.linalg.norm(aligned[:3, :3] - true[:3, :3]) / np.sqrt(8)  # of half the angle
    return float(2 * np.degrees(np.arcsin(min(half_sine, 1.0))))


def mounted_sensors(reader: BagReader) -> dict[tuple[str, str], Float64]:
    if TF_STATIC.name not in reader.topics:
        return {}
    return {
        (one.header.frame_id, one.child_frame_id): build.se3_from_transform(one.transform)
        for _, message in reader.messages(TF_STATIC.name)
        for one in message.transforms
    }
