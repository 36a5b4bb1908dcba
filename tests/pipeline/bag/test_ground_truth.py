"""Ground truth as CARLA's bridge states it: a bag that rosbags writes, with the types of its packages."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr

TYPES = {
    "derived_object_msgs/msg/ObjectArray": """\
std_msgs/Header header
derived_object_msgs/Object[] objects
""",
    "derived_object_msgs/msg/Object": """\
std_msgs/Header header
uint32 id
uint8 detection_level
bool object_classified
geometry_msgs/Pose pose
geometry_msgs/Twist twist
geometry_msgs/Accel accel
geometry_msgs/Polygon polygon
shape_msgs/SolidPrimitive shape
uint8 classification
uint8 classification_certainty
uint32 classification_age
""",
}
CAR, PEDESTRIAN, SIGN = 6, 4, 11
BOX, CYLINDER = 1, 3


def write_objects(path: Path, shape: int = BOX) -> Path:
    """A car, a pedestrian and a sign, each turned about, beside a cloud in whose frame they are."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in TYPES.items():
        store.register(get_types_from_msg(text, name))

    def made(name: str, *values: object) -> object:
        return store.types[name](*values)

    still = made("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    header = made("std_msgs/msg/Header", made("builtin_interfaces/msg/Time", 1, 0), "hero/lidar")
    polygon = made("geometry_msgs/msg/Polygon", [])
    objects = [
        made(
            "derived_object_msgs/msg/Object",
            header,
            number,
            1,
            True,
            made(
                "geometry_msgs/msg/Pose",
                made("geometry_msgs/msg/Point", 10.0 * number, 2.0, -1.0),
                made("geometry_msgs/msg/Quaternion", 0.0, 0.0, 1.0, 0.0),
            ),
            made("geometry_msgs/msg/Twist", still, still),
            made("geometry_msgs/msg/Accel", still, still),
            polygon,
            made("shape_msgs/msg/SolidPrimitive", shape, np.array(size_m), polygon),
            kind,
            255,
            0,
        )
        for number, (kind, size_m) in enumerate(
            [(CAR, [4.5, 1.8, 1.6]), (PEDESTRIAN, [0.5, 0.6, 1.7]), (SIGN, [0.1, 0.6, 0.6])], start=1
        )
    ]
    type_name = "derived_object_msgs/msg/ObjectArray"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        clouds = writer.add_connection("/hero/lidar", "sensor_msgs/msg/PointCloud2", typestore=store)
        truth = writer.add_connection("/hero/objects", type_name, typestore=store)
        writer.write(clouds, 10**9, cloud_to_cdr(np.zeros(1, POINT_DTYPE), 10**9, "hero/lidar"))
        writer.write(truth, 10**9, store.serialize_cdr(made(type_name, header, objects), type_name))
    return path


def test_road_users_of_another_package(tmp_path: Path) -> None:
    (frame,) = read_frames(write_objects(tmp_path / "bag"))
    assert frame.boxes.ids == ("1", "2")
    assert [CLASSES[label] for label in frame.boxes.labels] == ["car", "pedestrian"]
    expected = [[10, 2, -1, 4.5, 1.8, 1.6, np.pi], [20, 2, -1, 0.5, 0.6, 1.7, np.pi]]
    np.testing.assert_allclose(frame.boxes.geometry, expected, atol=1e-12)


def test_an_object_that_is_no_box_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="'1', whose shape is not a box"):
        list(read_frames(write_objects(tmp_path / "bag", CYLINDER)))
