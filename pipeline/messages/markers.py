"""Boxes and lanes as visualization_msgs/MarkerArray, which both RViz and Foxglove draw."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.build import box_pose, message_header, pose, vector3
from advpipe.pipeline.messages.types import message_class

CLASS_COLOURS_RGB = {
    "car": (0.12, 0.47, 0.71),
    "truck": (0.58, 0.40, 0.74),
    "cyclist": (1.00, 0.50, 0.05),
    "pedestrian": (0.17, 0.63, 0.17),
}
LANE_GREY = 0.5
OPACITY = 0.5

Lane = tuple[Float64, float]
"""The centre line (K, 3) of a lane in the driving direction, in the map frame, and its width, in metres."""


def markers(stamp_ns: int, frame_id: str, boxes: Boxes) -> Any:
    """One cube for each box in the frame `frame_id`, coloured by class, and a marker that clears old ones."""
    Marker = message_class("visualization_msgs/msg/Marker")
    clear = marker(stamp_ns, frame_id, action=Marker.DELETEALL)
    cubes = [
        marker(
            stamp_ns,
            frame_id,
            action=Marker.ADD,
            type=Marker.CUBE,
            ns=CLASSES[label],
            id=number,
            pose=box_pose(box),
            scale=vector3(box[3:6]),
            color=colour(CLASS_COLOURS_RGB[CLASSES[label]]),
        )
        for number, (box, label) in enumerate(zip(boxes.geometry, boxes.labels, strict=True))
    ]
    return message_class("visualization_msgs/msg/MarkerArray")(markers=[clear, *cubes])


def lane_markers(stamp_ns: int, frame_id: str, lanes: Sequence[Lane]) -> Any:
    """One line for each lane along its centre line, as wide as the lane."""
    Marker, Point = message_class("visualization_msgs/msg/Marker"), message_class("geometry_msgs/msg/Point")
    lines = [
        marker(
            stamp_ns,
            frame_id,
            action=Marker.ADD,
            type=Marker.LINE_STRIP,
            ns="lanes",
            id=number,
            scale=vector3([width_m, 0, 0]),
            color=colour((LANE_GREY,) * 3),
            points=[Point(x=x, y=y, z=z) for x, y, z in centre_line_m.tolist()],
        )
        for number, (centre_line_m, width_m) in enumerate(lanes)
    ]
    return message_class("visualization_msgs/msg/MarkerArray")(markers=lines)


def lanes_of_markers(message: Any) -> Iterable[Lane]:
    """The lanes in a message of `lane_markers`."""
    for marker in message.markers:
        yield np.array([[p.x, p.y, p.z] for p in marker.points]).reshape(-1, 3), float(marker.scale.x)


@cache
def colour(rgb: tuple[float, ...]) -> Any:
    red, green, blue = rgb
    return message_class("std_msgs/msg/ColorRGBA")(r=red, g=green, b=blue, a=OPACITY)


def marker(stamp_ns: int, frame_id: str, **values: Any) -> Any:
    parts = {**_defaults(), "header": message_header(stamp_ns, frame_id), **values}
    return message_class("visualization_msgs/msg/Marker")(**parts)


@cache
def _defaults() -> dict[str, Any]:
    """The fields that advpipe's markers leave at their defaults; made once, since there are many markers."""
    empty_image = message_class("sensor_msgs/msg/CompressedImage")(
        header=message_header(0, ""), format="", data=np.zeros(0, np.uint8)
    )
    empty_mesh = message_class("visualization_msgs/msg/MeshFile")(filename="", data=np.zeros(0, np.uint8))
    return {
        "ns": "",
        "id": 0,
        "type": 0,
        "action": 0,
        "pose": pose(np.eye(4)),
        "scale": vector3([0, 0, 0]),
        "color": message_class("std_msgs/msg/ColorRGBA")(r=0.0, g=0.0, b=0.0, a=0.0),
        "lifetime": message_class("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        "frame_locked": False,
        "points": [],
        "colors": [],
        "texture_resource": "",
        "texture": empty_image,
        "uv_coordinates": [],
        "text": "",
        "mesh_resource": "",
        "mesh_file": empty_mesh,
        "mesh_use_embedded_materials": False,
    }
