"""Whether the ground-truth boxes contain as many LiDAR points as the bag states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, points_in_boxes
from advpipe.pipeline.geometry.transforms import Float64, invert, yaw_of
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.messages.topics import TF_STATIC, VehicleTopics
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import BagUnderTest

MARGIN_M = 1e-5
"""Tolerance at faces of boxes, since poses are rounded in quaternions; small, because many points of the road
lie near the lower face."""

_USERS, _TRUTH = VehicleTopics("").road_users.name, VehicleTopics("").true_odometry.name


@dataclass
class _Instant:
    """One vehicle's clouds and ground truth at one stamp."""

    stamp_ns: int
    clouds: list[RawMessage] = field(default_factory=list)
    users: Any = None
    odometry: Any = None


class BoxesHoldPoints(MessageCheck):
    """Counts the points of all clouds of a step together, as the simulation does; clean bags only.

    With motion distortion, the simulation counted points at their positions at the stamp, so boxes are
    enlarged and shrunk by the vehicle's largest own motion in one revolution.
    """

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._mounts: dict[str, tuple[str, Float64]] = {}
        self._instants: dict[str, _Instant] = {}
        self._is_active = bag.is_own and not bag.is_attack
        self._lidars: frozenset[str] = frozenset()
        self._has_reported, self._unreadable = False, ""
        try:
            self._lidars = frozenset(lidar_topics(bag.reader)) if self._is_active else frozenset()
        except AdvpipeError as error:
            self._unreadable = str(error)

    def see(self, view: MessageView) -> Iterator[Result]:
        if not self._is_active:
            return
        raw, name = view.raw, view.raw.topic.name
        if name == TF_STATIC.name and view.message is not None:
            for transform in view.message.transforms:
                base_SE3_child = build.se3_from_transform(transform.transform)
                self._mounts[transform.child_frame_id] = (transform.header.frame_id, base_SE3_child)
            return
        vehicle = name.removeprefix("/").partition("/")[0]
        rest = name.removeprefix(f"/{vehicle}")
        if name not in self._lidars and rest not in (_USERS[1:], _TRUTH[1:]):
            return
        instant = self._instants.get(vehicle)
        if instant is not None and instant.stamp_ns != raw.log_time_ns:
            yield from self._recount(vehicle, instant)
            instant = None
        if instant is None:
            instant = self._instants[vehicle] = _Instant(raw.log_time_ns)
        if name in self._lidars:
            instant.clouds.append(raw)
        elif rest == _USERS[1:]:
            instant.users = view.message
        else:
            instant.odometry = view.message

    def check(self) -> Iterator[Result]:
        if self._unreadable:
            yield Unchecked(self.bag.place, f"the LiDAR topics cannot be determined: {self._unreadable}")
        for vehicle, instant in self._instants.items():
            yield from self._recount(vehicle, instant)

    def _recount(self, vehicle: str, instant: _Instant) -> Iterator[Result]:
        if instant.users is None or not instant.clouds:
            return
        where = f"{self.bag.place} {VehicleTopics(vehicle).road_users.name}"
        if instant.odometry is None:
            yield Fault(where, f"no true pose at {instant.stamp_ns} ns")
            return
        stated = np.array([user.lidar_points for user in instant.users.road_users], np.int64)
        boxes = _boxes(instant.users.road_users)
        margin_m = MARGIN_M + self._motion_m(instant.odometry)
        if margin_m > MARGIN_M and not self._has_reported:
            self._has_reported = True
            yield Unchecked(where, "points of LiDARs with motion distortion are recounted approximately")
        least, most = np.zeros(len(stated), np.int64), np.zeros(len(stated), np.int64)
        for raw in instant.clouds:
            try:
                _, frame_id, cloud = self.bag.reader.cloud(raw)
            except AdvpipeError as error:
                yield Fault(f"{self.bag.place} {raw.topic.name}", str(error))
                return
            base_frame, base_SE3_lidar = self._mounts.get(frame_id, ("", np.eye(4)))
            if base_frame != instant.odometry.child_frame_id:
                yield Fault(
                    where, f"no static transform connects {frame_id} to {instant.odometry.child_frame_id}"
                )
                return
            map_SE3_lidar = build.se3_from_pose(instant.odometry.pose.pose) @ base_SE3_lidar
            geometry = boxes.transformed(invert(map_SE3_lidar)).geometry
            points = xyz(cloud)
            least += _count(points, geometry, -margin_m)
            most += _count(points, geometry, margin_m)
        for index in np.flatnonzero((stated < least) | (stated > most)).tolist():
            yield Fault(
                where,
                f"{boxes.ids[index]} should hold {stated[index]} points at {instant.stamp_ns} ns, but holds "
                f"{least[index]} to {most[index]}",
            )

    def _motion_m(self, odometry: Any) -> float:
        """The largest displacement, in metres, of a point 100 m away by the vehicle's motion in one
        revolution."""
        lidars = ((self.bag.scenario or {}).get("sensors") or {}).get("lidars") or {}
        turns_s = [1 / lidar["rotation_frequency"] for lidar in lidars.values() if lidar["motion_distortion"]]
        if not turns_s:
            return 0.0
        linear, angular = odometry.twist.twist.linear, odometry.twist.twist.angular
        speed_mps = float(np.linalg.norm([linear.x, linear.y, linear.z]))
        turn_radps = float(np.linalg.norm([angular.x, angular.y, angular.z]))
        return float(max(turns_s) * (speed_mps + 100 * turn_radps))


def _boxes(users: Any) -> Boxes:
    geometry = np.zeros((len(users), 7))
    for row, user in enumerate(users):
        pose = build.se3_from_pose(user.pose)
        geometry[row] = (*pose[:3, 3], user.size.x, user.size.y, user.size.z, yaw_of(pose))
    labels = np.array([CLASSES.index(u.class_id) if u.class_id in CLASSES else 0 for u in users], np.int64)
    return Boxes(geometry, labels, tuple(user.id for user in users), np.zeros((len(users), 3)))


def _count(points: Any, geometry: Float64, margin_m: float) -> Any:
    return np.array([len(inside) for inside in points_in_boxes(points, geometry, margin_m)], np.int64)
