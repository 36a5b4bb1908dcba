"""Records drives as ROS 1, SQLite and MCAP with rosbags, in the messages of CARLA's bridge and of others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from advpipe.pipeline.geometry.transforms import Float64, quaternion_xyzw, se3_from_yaw
from advpipe.pipeline.messages.types import typestore
from advpipe.stages.import_.rosbag.definitions import DEFINITIONS

START_NS, STEP_NS = 1_700_000_000_000_000_000, 100_000_000
JSK = {
    "jsk_recognition_msgs/msg/BoundingBox": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Vector3 dimensions\n"
        "float32 value\nuint32 label\n"
    ),
    "jsk_recognition_msgs/msg/BoundingBoxArray": (
        "std_msgs/Header header\njsk_recognition_msgs/BoundingBox[] boxes\n"
    ),
}
LIVOX = {
    "livox_ros_driver2/msg/CustomPoint": (
        "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
    ),
    "livox_ros_driver2/msg/CustomMsg": (
        "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
        "livox_ros_driver2/CustomPoint[] points\n"
    ),
}
FORMATS = ("ros1", "sqlite", "mcap")


def store_for(form: str) -> Typestore:
    """The types of a release with those of CARLA's, Autoware's, jsk's and Livox's packages."""
    store = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    if form == "ros1":
        store.register(get_types_from_msg("uint8[16] uuid\n", "unique_identifier_msgs/msg/UUID"))
        transforms = "geometry_msgs/TransformStamped[] transforms\n"
        store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
    vision = {k: v for k, v in typestore().fielddefs.items() if k.startswith("vision_msgs/")}
    store.register(vision)
    for name, text in {**DEFINITIONS, **JSK, **LIVOX}.items():
        store.register(get_types_from_msg(text, name))
    return store


class Made:
    """Makes messages of a store's types."""

    def __init__(self, form: str) -> None:
        self.form, self.store = form, store_for(form)

    def __call__(self, type_name: str, **fields: Any) -> Any:
        return self.store.types[type_name](**fields)

    def time(self, stamp_ns: int) -> Any:
        return self("builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        counted = {"seq": 0} if self.form == "ros1" else {}
        return self("std_msgs/msg/Header", stamp=self.time(stamp_ns), frame_id=frame_id, **counted)

    def vector(self, values: Iterable[float], name: str = "Vector3") -> Any:
        x, y, z = map(float, values)
        return self(f"geometry_msgs/msg/{name}", x=x, y=y, z=z)

    def rotation(self, pose: Float64) -> Any:
        x, y, z, w = quaternion_xyzw(pose).tolist()
        return self("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, pose: Float64) -> Any:
        position = self.vector(pose[:3, 3], "Point")
        return self("geometry_msgs/msg/Pose", position=position, orientation=self.rotation(pose))

    def twist(self, linear: Iterable[float] = (0, 0, 0)) -> Any:
        zero = self.vector((0, 0, 0))
        return self("geometry_msgs/msg/Twist", linear=self.vector(linear), angular=zero)

    def with_covariance(self, kind: str, value: Any) -> Any:
        name, field = f"geometry_msgs/msg/{kind}WithCovariance", kind.lower()
        return self(name, **{field: value}, covariance=np.zeros(36))

    def tf(self, stamp_ns: int, *links: tuple[str, str, Float64]) -> Any:
        transforms = [
            self(
                "geometry_msgs/msg/TransformStamped",
                header=self.header(stamp_ns, parent),
                child_frame_id=child,
                transform=self(
                    "geometry_msgs/msg/Transform",
                    translation=self.vector(pose[:3, 3]),
                    rotation=self.rotation(pose),
                ),
            )
            for parent, child, pose in links
        ]
        return self("tf2_msgs/msg/TFMessage", transforms=transforms)

    def odometry(self, stamp_ns: int, parent: str, child: str, pose: Float64) -> Any:
        return self(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            pose=self.with_covariance("Pose", self.pose(pose)),
            twist=self.with_covariance("Twist", self.twist()),
        )

    def cloud(self, stamp_ns: int, frame_id: str, points: np.ndarray, **changed: Any) -> Any:
        codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        Field = self.store.types["sensor_msgs/msg/PointField"]
        described = points.dtype.fields or {}
        fields = [
            Field(name=name, offset=described[name][1], datatype=codes[described[name][0].str[1:]], count=1)
            for name in points.dtype.names or ()
        ]
        values = {
            "header": self.header(stamp_ns, frame_id),
            "height": 1,
            "width": len(points),
            "fields": fields,
            "is_bigendian": False,
            "point_step": points.dtype.itemsize,
            "row_step": points.nbytes,
            "data": np.frombuffer(points.tobytes(), np.uint8),
            "is_dense": True,
        }
        return self("sensor_msgs/msg/PointCloud2", **{**values, **changed})

    def derived_object(self, number: int, pose: Float64, size: Iterable[float], kind: int, speed: Any) -> Any:
        zero = self.vector((0, 0, 0))
        polygon = {"polygon": self("geometry_msgs/msg/Polygon", points=[])}
        shape = {"type": 1, "dimensions": np.array(list(size), np.float64)}
        if self.form != "ros1":
            shape["polygon"] = polygon["polygon"]
        return self(
            "derived_object_msgs/msg/Object",
            header=self.header(0, "map"),
            id=number,
            detection_level=0,
            object_classified=True,
            pose=self.pose(pose),
            twist=self.twist(speed),
            accel=self("geometry_msgs/msg/Accel", linear=zero, angular=zero),
            shape=self("shape_msgs/msg/SolidPrimitive", **shape),
            classification=kind,
            classification_certainty=255,
            classification_age=1,
            **polygon,
        )


Messages = Iterable[tuple[str, str, int, Any]]
"""Topic, type, log time and message."""


def record(path: Path, form: str, messages: Callable[[Made], Messages]) -> Path:
    """Record messages; returns the file of ROS 1 or the directory of ROS 2."""
    made = Made(form)
    writer: Any
    if form == "ros1":
        writer, serialise = Ros1Writer(path.with_suffix(".bag")), made.store.serialize_ros1
    else:
        plugin = StoragePlugin.SQLITE3 if form == "sqlite" else StoragePlugin.MCAP
        writer, serialise = Ros2Writer(path, version=8, storage_plugin=plugin), made.store.serialize_cdr
    connections: dict[str, Any] = {}
    with writer as bag:
        for topic, type_name, log_ns, message in messages(made):
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, type_name, typestore=made.store)
            bag.write(connections[topic], log_ns, serialise(message, type_name))
    return path.with_suffix(".bag") if form == "ros1" else path


EGO, LIDAR = "ego_vehicle", "ego_vehicle/lidar"
EGO_SE3_LIDAR = se3_from_yaw((-0.2, 0.0, 2.4), 0.0)
CAR_SIZE, WALKER_SIZE, EGO_SIZE = (4.8, 2.1, 1.5), (0.4, 0.4, 1.9), (4.9, 2.2, 1.6)


def ego_pose(stamp_ns: int) -> Float64:
    """A vehicle at 10 m/s that turns by 0.1 rad a second."""
    elapsed_s = (stamp_ns - START_NS) / 1e9
    return se3_from_yaw((10 * elapsed_s, 3.0, 0.5), 0.1 * elapsed_s)


def car_pose(stamp_ns: int) -> Float64:
    """Its origin on the ground, as CARLA gives it."""
    return se3_from_yaw((30.0 + 5 * (stamp_ns - START_NS) / 1e9, 6.0, 0.5), 0.4)


WALKER_POSE = se3_from_yaw((12.0, -4.0, 1.45), 0.0)
"""Its origin in its middle, as CARLA gives it."""


def carla_points(seed: int) -> np.ndarray:
    points = np.zeros(200, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
    rng = np.random.default_rng(seed)
    for name, scale in (("x", 20), ("y", 20), ("z", 0.5), ("intensity", 0.3)):
        points[name] = np.clip(rng.normal(0, scale, 200), -60, 60)
    points["intensity"] = np.abs(points["intensity"]).clip(0, 1)
    return points


def carla(
    made: Made, frames: int = 4, *, objects: str = "/carla/objects", is_asynchronous: bool = False
) -> Messages:
    """What CARLA's bridge publishes in a synchronous run: every message of a tick has the same stamp."""
    for frame in range(frames):
        stamp_ns = START_NS + frame * STEP_NS
        ego = ego_pose(stamp_ns)
        mount = ("map", LIDAR, ego @ EGO_SE3_LIDAR) if is_asynchronous else (EGO, LIDAR, EGO_SE3_LIDAR)
        yield "/tf", "tf2_msgs/msg/TFMessage", stamp_ns, made.tf(stamp_ns, ("map", EGO, ego), mount)
        around = [
            made.derived_object(24, ego, EGO_SIZE, 6, (10, 0, 0)),
            made.derived_object(31, car_pose(stamp_ns), CAR_SIZE, 6, (5, 0, 0)),
            made.derived_object(40, WALKER_POSE, WALKER_SIZE, 4, (0, 0, 0)),
            made.derived_object(41, car_pose(stamp_ns), CAR_SIZE, 9, (0, 0, 0)),
        ]
        for topic in dict.fromkeys((objects, "/carla/objects")):
            array = made(
                "derived_object_msgs/msg/ObjectArray",
                header=made.header(stamp_ns, "map"),
                objects=around if topic == "/carla/objects" else around[1:],
            )
            yield topic, "derived_object_msgs/msg/ObjectArray", stamp_ns + 1000, array
        odometry = made.odometry(stamp_ns, "map", EGO, ego)
        yield f"/carla/{EGO}/odometry", "nav_msgs/msg/Odometry", stamp_ns + 2000, odometry
        cloud = made.cloud(stamp_ns, LIDAR, carla_points(frame))
        yield f"/carla/{EGO}/lidar", "sensor_msgs/msg/PointCloud2", stamp_ns + 3000, cloud
        radar = made.cloud(stamp_ns, f"{EGO}/radar_front", carla_points(9))
        yield f"/carla/{EGO}/radar_front", "sensor_msgs/msg/PointCloud2", stamp_ns + 3000, radar
