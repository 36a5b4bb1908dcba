"""Boxes of ROS recordings: each type of message, as it is defined or not."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.rosbag.form import RosbagForm

sys.path.insert(0, str(Path(__file__).parent))

import ros_drives
from point_bytes import some_points
from ros_drives import START_NS, Made, Messages, record

CLOUD = "sensor_msgs/msg/PointCloud2"


def opened(source: Path, **options: object):
    return RosbagForm().open(source, ImportOptions(**options))


def boxes_of(type_name: str):
    """A recording with a cloud and one box of this type, at (10, 2, -0.5), 4.2 x 1.9 x 1.6 m, yaw 0.3."""

    def messages(made: Made) -> Messages:
        pose, size = made.pose(se3_from_yaw((10, 2, -0.5), 0.3)), made.vector((4.2, 1.9, 1.6))
        header = made.header(START_NS, "lidar")
        yield "/points", "sensor_msgs/msg/PointCloud2", START_NS, made.cloud(START_NS, "lidar", some_points())
        package = type_name.split("/")[0]
        if package == "vision_msgs":
            hypothesis = made("vision_msgs/msg/ObjectHypothesis", class_id="Bus", score=1.0)
            covered = made.with_covariance("Pose", pose)
            result = made("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=covered)
            bounds = made("vision_msgs/msg/BoundingBox3D", center=pose, size=size)
            one = made("vision_msgs/msg/Detection3D", header=header, results=[result], bbox=bounds, id="7")
            message = made(type_name, header=header, detections=[one])
        elif package == "jsk_recognition_msgs":
            item = "jsk_recognition_msgs/msg/BoundingBox"
            one = made(item, header=header, pose=pose, dimensions=size, value=1.0, label=3)
            message = made(type_name, header=header, boxes=[one])
        elif package == "visualization_msgs":
            message = made(type_name, markers=[cube(made, header, pose, size)])
        else:
            message = made(type_name, header=header, objects=[tracked(made, pose, size)])
        yield "/boxes", type_name, START_NS + 1, message

    return messages


def cube(made: Made, header, pose, size):
    kind = made.store.types["visualization_msgs/msg/Marker"]
    zero = made.store.types["std_msgs/msg/ColorRGBA"](r=1.0, g=0.0, b=0.0, a=1.0)
    duration = made("builtin_interfaces/msg/Duration", sec=0, nanosec=0)
    given = {
        "header": header, "ns": "bus", "id": 7, "type": 1, "action": 0, "pose": pose, "scale": size,
        "color": zero, "lifetime": duration, "frame_locked": False, "points": [], "colors": [], "text": "",
        "mesh_resource": "", "mesh_use_embedded_materials": False,
    }  # fmt: skip
    if made.form != "ros1":
        image = made.store.types["sensor_msgs/msg/CompressedImage"]
        given["texture_resource"], given["uv_coordinates"] = "", []
        given["texture"] = image(header=header, format="", data=np.zeros(0, np.uint8))
        given["mesh_file"] = made("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8))
    return kind(**given)


def tracked(made: Made, pose, size):
    package = "autoware_perception_msgs/msg"
    twist = made.with_covariance("Twist", made.twist((2, 0, 0)))
    zero = made.vector((0, 0, 0))
    accel = made("geometry_msgs/msg/Accel", linear=zero, angular=zero)
    return made(
        f"{package}/TrackedObject",
        object_id=made("unique_identifier_msgs/msg/UUID", uuid=np.arange(16, dtype=np.uint8)),
        existence_probability=1.0,
        classification=[made(f"{package}/ObjectClassification", label=3, probability=0.9)],
        kinematics=made(
            f"{package}/TrackedObjectKinematics",
            pose_with_covariance=made.with_covariance("Pose", pose),
            twist_with_covariance=twist,
            acceleration_with_covariance=made.with_covariance("Accel", accel),
            orientation_availability=2,
            is_stationary=False,
        ),
        shape=made(
            f"{package}/Shape",
            type=0,
            footprint=made("geometry_msgs/msg/Polygon", points=[]),
            dimensions=size,
        ),
    )


@pytest.mark.parametrize(
    ("type_name", "form", "options", "name"),
    [
        ("vision_msgs/msg/Detection3DArray", "ros1", {}, "7"),
        ("vision_msgs/msg/Detection3DArray", "sqlite", {}, "7"),
        ("autoware_perception_msgs/msg/TrackedObjects", "sqlite", {}, bytes(range(16)).hex()),
        ("autoware_perception_msgs/msg/TrackedObjects", "mcap", {}, bytes(range(16)).hex()),
        ("jsk_recognition_msgs/msg/BoundingBoxArray", "ros1", {"classes": {"3": "truck"}}, ""),
        ("jsk_recognition_msgs/msg/BoundingBoxArray", "mcap", {"classes": {"3": "truck"}}, ""),
        ("visualization_msgs/msg/MarkerArray", "ros1", {"objects": "/boxes"}, "7"),
        ("visualization_msgs/msg/MarkerArray", "mcap", {"objects": "/boxes"}, "7"),
    ],
)
def test_boxes_of_all_types(type_name, form, options, name, tmp_path: Path) -> None:
    bag = record(tmp_path / "r", form, boxes_of(type_name))
    (frame,) = opened(bag, **options).frames()
    boxes = frame.vehicles["ego"].boxes
    assert np.allclose(boxes.geometry, [[10, 2, -0.5, 4.2, 1.9, 1.6, 0.3]], rtol=0, atol=1e-12)
    assert boxes.labels.tolist() == [1]
    assert boxes.ids == (name,)
    if "autoware" in type_name:
        assert np.allclose(boxes.velocity_mps, [[2 * np.cos(0.3), 2 * np.sin(0.3), 0]])


def test_types_that_a_recording_does_not_define(tmp_path: Path) -> None:
    """SQLite before Iron names types without defining them: those of jsk are unknown, CARLA's are known."""
    import sqlite3

    for name, source in {
        "known": ros_drives.carla,
        "other": boxes_of(next(reversed(ros_drives.JSK))),
    }.items():
        bag = record(tmp_path / name, "sqlite", source)
        with sqlite3.connect(bag / f"{name}.db3") as base:
            base.execute("DELETE FROM message_definitions")
    assert len(list(opened(tmp_path / "known").frames())) == 4
    with pytest.raises(AdvpipeError, match="does not define and advpipe does not know"):
        list(opened(tmp_path / "other").frames())


def test_markers_are_read_only_where_they_are_asked_for(tmp_path: Path) -> None:
    bag = record(tmp_path / "r", "mcap", boxes_of("visualization_msgs/msg/MarkerArray"))
    (frame,) = opened(bag).frames()
    assert frame.vehicles["ego"].boxes is None
