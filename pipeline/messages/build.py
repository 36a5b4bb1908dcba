"""Converts advpipe's values to small ROS 2 messages and back: poses, transforms, boxes, fixes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import (
    Float64,
    quaternion_xyzw,
    rotations_from_quaternions,
    se3_from_quaternion,
)
from advpipe.pipeline.messages.types import message_class

NS_PER_S = 1_000_000_000

_Time = message_class("builtin_interfaces/msg/Time")
_Header = message_class("std_msgs/msg/Header")
_Point = message_class("geometry_msgs/msg/Point")
_Vector3 = message_class("geometry_msgs/msg/Vector3")
_Quaternion = message_class("geometry_msgs/msg/Quaternion")
_Pose = message_class("geometry_msgs/msg/Pose")
_PoseWithCovariance = message_class("geometry_msgs/msg/PoseWithCovariance")


def time(stamp_ns: int) -> Any:
    """builtin_interfaces/Time from a stamp in nanoseconds since the epoch."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return _Time(sec=seconds, nanosec=nanoseconds)


def message_header(stamp_ns: int, frame_id: str) -> Any:
    """The header (std_msgs/msg/Header) of a measurement at `stamp_ns` nanoseconds in a frame."""
    return _Header(stamp=time(stamp_ns), frame_id=frame_id)


def stamp_ns(message: Any) -> int:
    """The stamp in a message's header, in nanoseconds since the epoch."""
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def point(xyz_m: npt.ArrayLike) -> Any:
    """geometry_msgs/Point from coordinates (3,)."""
    return _Point(*(float(value) for value in np.asarray(xyz_m)))


def vector3(xyz: npt.ArrayLike) -> Any:
    """geometry_msgs/Vector3 from components (3,)."""
    return _Vector3(*(float(value) for value in np.asarray(xyz)))


def quaternion(a_SE3_b: Float64) -> Any:
    """geometry_msgs/Quaternion from the rotation of a transform (4, 4)."""
    return _Quaternion(*(float(value) for value in quaternion_xyzw(a_SE3_b)))


def pose(a_SE3_b: Float64) -> Any:
    """geometry_msgs/Pose of frame b in frame a, from a transform (4, 4)."""
    return _Pose(position=point(a_SE3_b[:3, 3]), orientation=quaternion(a_SE3_b))


def box_pose(box: npt.ArrayLike) -> Any:
    """geometry_msgs/Pose of the centre of an upright box (7,)."""
    x_m, y_m, z_m, *_, yaw_rad = np.asarray(box, dtype=np.float64)
    half_yaw = yaw_rad / 2
    orientation = _Quaternion(x=0.0, y=0.0, z=float(np.sin(half_yaw)), w=float(np.cos(half_yaw)))
    return _Pose(position=point([x_m, y_m, z_m]), orientation=orientation)


def odometry(
    stamp_ns: int,
    map_SE3_base: Float64,
    base_velocity_mps: npt.ArrayLike,
    base_turn_rate_radps: npt.ArrayLike,
    *,
    frame_id: str = "map",
    child_frame_id: str = "ego/base_link",
    pose_covariance: npt.ArrayLike | None = None,
    twist_covariance: npt.ArrayLike | None = None,
) -> Any:
    """nav_msgs/Odometry; the velocities (3,) are in the child frame, as REP-105 specifies.

    The covariances (6, 6) are those of x, y, z and of the rotations about x, y, z: of the pose along the axes
    of the header's frame, of the twist along the axes of the child frame. By default they are zero.
    """
    twist = message_class("geometry_msgs/msg/Twist")(
        linear=vector3(base_velocity_mps), angular=vector3(base_turn_rate_radps)
    )
    return message_class("nav_msgs/msg/Odometry")(
        header=message_header(stamp_ns, frame_id),
        child_frame_id=child_frame_id,
        pose=_PoseWithCovariance(pose=pose(map_SE3_base), covariance=_flat(pose_covariance)),
        twist=message_class("geometry_msgs/msg/TwistWithCovariance")(
            twist=twist, covariance=_flat(twist_covariance)
        ),
    )


def initial_pose(
    stamp_ns: int,
    position_m: npt.ArrayLike,
    xyzw: npt.ArrayLike,
    covariance: npt.ArrayLike,
    *,
    frame_id: str = "map",
) -> Any:
    """geometry_msgs/PoseWithCovarianceStamped from a position (3,), a quaternion (4,) x, y, z, w and the
    covariance (6, 6) of the pose, as in `odometry`."""
    orientation = _Quaternion(*(float(value) for value in np.asarray(xyzw)))
    return message_class("geometry_msgs/msg/PoseWithCovarianceStamped")(
        header=message_header(stamp_ns, frame_id),
        pose=_PoseWithCovariance(
            pose=_Pose(position=point(position_m), orientation=orientation), covariance=_flat(covariance)
        ),
    )


def imu(
    stamp_ns: int,
    specific_force_mps2: npt.ArrayLike,
    angular_rate_radps: npt.ArrayLike,
    *,
    force_stddev_mps2: float = 0.0,
    rate_stddev_radps: float = 0.0,
    frame_id: str = "ego/imu",
) -> Any:
    """sensor_msgs/Imu from a specific force (3,), +9.80665 m/s² along z at rest, and an angular rate (3,).

    The standard deviations are those of the white noise on each axis. The message states no orientation: its
    covariance starts with -1, as the message's definition specifies.
    """
    no_orientation = np.zeros(9)
    no_orientation[0] = -1.0
    return message_class("sensor_msgs/msg/Imu")(
        header=message_header(stamp_ns, frame_id),
        orientation=_Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=no_orientation,
        angular_velocity=vector3(angular_rate_radps),
        angular_velocity_covariance=(rate_stddev_radps**2 * np.eye(3)).ravel(),
        linear_acceleration=vector3(specific_force_mps2),
        linear_acceleration_covariance=(force_stddev_mps2**2 * np.eye(3)).ravel(),
    )


def nav_sat_fix(
    stamp_ns: int,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    *,
    std_m: Sequence[float] = (0.0, 0.0, 0.0),
    frame_id: str = "ego/gnss",
    is_fix: bool = True,
) -> Any:
    """sensor_msgs/NavSatFix; `std_m` holds the standard deviations (3,) to the east, north and up.

    is_fix: False sets STATUS_NO_FIX (a receiver without satellites), whatever the position.
    """
    status = message_class("sensor_msgs/msg/NavSatStatus")(status=0 if is_fix else -1, service=1)
    return message_class("sensor_msgs/msg/NavSatFix")(
        header=message_header(stamp_ns, frame_id),
        status=status,
        latitude=float(latitude_deg),
        longitude=float(longitude_deg),
        altitude=float(altitude_m),
        position_covariance=np.diag(np.square(np.asarray(std_m, dtype=np.float64))).ravel(),
        position_covariance_type=2,
    )


def transforms(stamp_ns: int, parent_SE3_child: Iterable[tuple[str, str, Float64]]) -> Any:
    """tf2_msgs/TFMessage from tuples (parent frame, child frame, transform (4, 4))."""
    Transform = message_class("geometry_msgs/msg/Transform")
    TransformStamped = message_class("geometry_msgs/msg/TransformStamped")
    return message_class("tf2_msgs/msg/TFMessage")(
        transforms=[
            TransformStamped(
                header=message_header(stamp_ns, parent),
                child_frame_id=child,
                transform=Transform(translation=vector3(matrix[:3, 3]), rotation=quaternion(matrix)),
            )
            for parent, child, matrix in parent_SE3_child
        ]
    )


def detections_message(stamp_ns: int, frame_id: str, boxes: Boxes) -> Any:
    """vision_msgs/Detection3DArray of boxes in the frame `frame_id`, each with score 1."""
    class_names = [CLASSES[label] for label in boxes.labels]
    return boxes_message(stamp_ns, frame_id, boxes.geometry, class_names, boxes.ids)


def boxes_message(
    stamp_ns: int, frame_id: str, geometry: Float64, class_names: Sequence[str], ids: Sequence[str]
) -> Any:
    """vision_msgs/Detection3DArray of boxes (M, 7) in the frame `frame_id`, with the names of their M classes
    and their M ids, each with score 1."""
    Detection = message_class("vision_msgs/msg/Detection3D")
    Result = message_class("vision_msgs/msg/ObjectHypothesisWithPose")
    Hypothesis = message_class("vision_msgs/msg/ObjectHypothesis")
    Bounds = message_class("vision_msgs/msg/BoundingBox3D")
    items = []
    for box, class_name, name in zip(geometry, class_names, ids, strict=True):
        centre = box_pose(box)
        result = Result(
            hypothesis=Hypothesis(class_id=class_name, score=1.0),
            pose=_PoseWithCovariance(pose=centre, covariance=np.zeros(36)),
        )
        bounds = Bounds(center=centre, size=vector3(box[3:6]))
        items.append(
            Detection(header=message_header(stamp_ns, frame_id), results=[result], bbox=bounds, id=name)
        )
    return message_class("vision_msgs/msg/Detection3DArray")(
        header=message_header(stamp_ns, frame_id), detections=items
    )


def road_users(
    stamp_ns: int, frame_id: str, boxes: Boxes, lidar_points: npt.ArrayLike, occlusion: npt.ArrayLike
) -> Any:
    """advpipe_msgs/RoadUserArray of M boxes in the frame `frame_id`.

    lidar_points: (M,), number of LiDAR points on each. occlusion: (M,), the occluded share of each, 0 to 1.
    """
    RoadUser = message_class("advpipe_msgs/msg/RoadUser")
    return message_class("advpipe_msgs/msg/RoadUserArray")(
        header=message_header(stamp_ns, frame_id),
        road_users=[
            RoadUser(
                id=name,
                class_id=CLASSES[label],
                pose=box_pose(box),
                size=vector3(box[3:6]),
                velocity=vector3(velocity),
                lidar_points=int(points),
                occlusion=float(occluded),
            )
            for box, label, name, velocity, points, occluded in zip(
                boxes.geometry,
                boxes.labels,
                boxes.ids,
                boxes.velocity_mps,
                np.asarray(lidar_points),
                np.asarray(occlusion),
                strict=True,
            )
        ],
    )


def clock(stamp_ns: int) -> Any:
    """rosgraph_msgs/Clock."""
    return message_class("rosgraph_msgs/msg/Clock")(clock=time(stamp_ns))


def string(text: str) -> Any:
    """std_msgs/String."""
    return message_class("std_msgs/msg/String")(data=text)


def se3_from_pose(message: Any) -> Float64:
    """The (4, 4) matrix of a geometry_msgs/Pose."""
    return _se3(message.orientation, message.position)


def se3_from_poses(messages: Sequence[Any]) -> Float64:
    """The matrices (N, 4, 4) of several geometry_msgs/Pose: bit for bit those of `se3_from_pose`, faster."""
    map_SE3_poses: Float64 = np.tile(np.eye(4), (len(messages), 1, 1))
    if messages:
        rotations, positions = [one.orientation for one in messages], [one.position for one in messages]
        map_SE3_poses[:, :3, :3] = rotations_from_quaternions([(q.x, q.y, q.z, q.w) for q in rotations])
        map_SE3_poses[:, :3, 3] = [(p.x, p.y, p.z) for p in positions]
    return map_SE3_poses


def se3_from_transform(message: Any) -> Float64:
    """The (4, 4) matrix of a geometry_msgs/Transform."""
    return _se3(message.rotation, message.translation)


def _flat(covariance: npt.ArrayLike | None) -> Float64:
    """A covariance (6, 6) as (36,), row by row as in ROS; zeros for None."""
    return np.zeros(36) if covariance is None else np.array(covariance, dtype=np.float64).ravel()


def _se3(rotation: Any, translation: Any) -> Float64:
    return se3_from_quaternion(
        [rotation.x, rotation.y, rotation.z, rotation.w], [translation.x, translation.y, translation.z]
    )
