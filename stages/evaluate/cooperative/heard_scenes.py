"""What one vehicle knows and sees at each instant of a drive with CPMs, and the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.latched import V2xInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points, yaw_of
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.messages.heard_objects import heard_objects_of_message
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject
from advpipe.stages.evaluate.cooperative.pair import mounted_sensors, poses
from advpipe.stages.evaluate.v2x.ldm_error import Known, Moment, moments

MOST_INSTANTS = 50
NEAR_M = 60.0
"""Road users and objects within this distance count."""


@dataclass(frozen=True)
class HeardScene:
    """One instant. users: (U, 7) true boxes of other road users in the map's frame, points: (U,) of its own
    LiDARs on each. heard: objects nearby. entries: stations in its map. cloud_m: (N, 3) its first LiDAR's
    points in that LiDAR's frame, lidar_SE3_map: (4, 4); no points without a LiDAR. stations_m: (S, 2), where
    all radios truly are."""

    time_ns: int
    at_m: Float64
    users: Float64
    points: Float64
    heard: tuple[HeardObject, ...]
    entries: tuple[Known, ...]
    stations_m: Float64
    cloud_m: Float64 = field(default_factory=lambda: np.zeros((0, 3)))
    lidar_SE3_map: Float64 = field(default_factory=lambda: np.eye(4))

    @property
    def heard_m(self) -> Float64:
        """(H, 2) places of the heard objects now."""
        return np.array([one.moved_m(self.time_ns) for one in self.heard]).reshape(-1, 2)

    @property
    def entries_m(self) -> Float64:
        """(E, 2) places of the stations in its map now."""
        return np.array([(one.x_m, one.y_m) for one in self.entries]).reshape(-1, 2)


def has_heard_objects(reader: BagReader, vehicle: str) -> bool:
    """Whether a bag holds what a vehicle has heard of in CPMs."""
    info = reader.topics.get(VehicleTopics(vehicle).heard_objects.name)
    return info is not None and info.count > 0


def heard_scenes(reader: BagReader, vehicle: str, window: Window = WHOLE_DRIVE) -> Iterator[HeardScene]:
    """At most `MOST_INSTANTS` instants, equally spaced, at which all topics of the vehicle have a message."""
    topics = VehicleTopics(vehicle)
    expiry_s = read_scenario_info(reader, V2xInfo).v2x.ldm.expiry_s
    times_ns = reader.log_times_ns(topics.heard_objects.name)
    times_ns = times_ns[window.holds(times_ns)]
    chosen = set(times_ns[:: max(-(-len(times_ns) // MOST_INSTANTS), 1)].tolist())
    lidar = _Lidar(reader, vehicle)
    for moment in moments(reader, vehicle, expiry_s, window):
        if moment.time_ns in chosen and (scene := _scene(reader, topics, moment, lidar)) is not None:
            yield scene


class _Lidar:
    """The clouds of a vehicle's first LiDAR, by the true pose of the vehicle."""

    def __init__(self, reader: BagReader, vehicle: str) -> None:
        found = [name for name in lidar_topics(reader) if name.split("/")[1] == vehicle]
        self._reader, self._topic = reader, found[0] if found else None
        self._map_SE3_base = poses(reader, VehicleTopics(vehicle).true_odometry.name)
        frames = VehicleTopics(vehicle, found[0].split("/")[2] if found else "lidar")
        self._base_SE3_lidar = mounted_sensors(reader).get((frames.base_frame, frames.lidar_frame))

    def at(self, time_ns: int) -> tuple[Float64, Float64]:
        """The cloud logged then, and lidar_SE3_map; no points without both."""
        pose = self._map_SE3_base.get(time_ns)
        if self._topic is None or pose is None or self._base_SE3_lidar is None:
            return np.zeros((0, 3)), np.eye(4)
        for raw in self._reader.raw_messages([self._topic], time_ns, time_ns):
            points_m = xyz(self._reader.cloud(raw).cloud).astype(np.float64)
            points_m = points_m[np.isfinite(points_m).all(axis=1) & (np.abs(points_m).max(axis=1) > 0.1)]
            return points_m, invert(pose @ self._base_SE3_lidar)
        return np.zeros((0, 3)), np.eye(4)


def _scene(reader: BagReader, topics: VehicleTopics, moment: Moment, lidar: _Lidar) -> HeardScene | None:
    names = [topics.heard_objects.name, topics.road_users.name]
    found = {
        raw.topic.name: reader.decode(raw)
        for raw in reader.raw_messages(names, moment.time_ns, moment.time_ns)
    }
    if len(found) < len(names):
        return None
    at_m = moment.own.map_SE3_base[:2, 3]
    boxes = _boxes(found[topics.road_users.name].road_users)
    points = np.array([user.lidar_points for user in found[topics.road_users.name].road_users], np.float64)
    cloud_m, lidar_SE3_map = lidar.at(moment.time_ns)
    heard = heard_objects_of_message(found[topics.heard_objects.name])
    near = tuple(one for one in heard if _distance_m(one.moved_m(moment.time_ns), at_m) <= NEAR_M)
    radios = (moment.own, *moment.others)
    return HeardScene(
        time_ns=moment.time_ns,
        at_m=at_m,
        users=boxes,
        points=points,
        heard=near,
        entries=moment.entries,
        stations_m=np.array([radio.map_SE3_base[:2, 3] for radio in radios]).reshape(-1, 2),
        cloud_m=cloud_m,
        lidar_SE3_map=lidar_SE3_map,
    )


def _boxes(users: Sequence[object]) -> Float64:
    rows = []
    for user in users:
        pose = build.se3_from_pose(user.pose)  # type: ignore[attr-defined]
        size = user.size  # type: ignore[attr-defined]
        rows.append([*pose[:3, 3], size.x, size.y, size.z, yaw_of(pose)])
    return np.array(rows, np.float64).reshape(-1, 7)


def box_in_lidar(one: HeardObject, time_ns: int, lidar_SE3_map: Float64) -> Float64 | None:
    """The box (7,) of a heard object at a time, in the LiDAR's frame; None where the CPM does not state it
    all."""
    sizes_m = one.length_m, one.width_m, one.height_m
    if not np.isfinite([*sizes_m, one.yaw_rad]).all() or min(sizes_m) <= 0:
        return None
    centre = transform_points(lidar_SE3_map, [*one.moved_m(time_ns), one.centre_m[2]])
    return np.array([*centre, *sizes_m, one.yaw_rad + yaw_of(lidar_SE3_map)])


def _distance_m(one: Sequence[float] | Float64, other: Sequence[float] | Float64) -> float:
    return float(np.hypot(one[0] - other[0], one[1] - other[1]))
