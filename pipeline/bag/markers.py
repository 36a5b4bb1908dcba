"""Boxes as visualization_msgs/MarkerArray: the one scene type that RViz and Foxglove both draw."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from advpipe.pipeline.bag.messages import box_pose, header, pose, vector3
from advpipe.pipeline.bag.types import message_class
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes

CLASS_COLOURS_RGB = {
    "car": (0.12, 0.47, 0.71),
    "truck": (0.58, 0.40, 0.74),
    "cyclist": (1.00, 0.50, 0.05),
    "pedestrian": (0.17, 0.63, 0.17),
}
OPACITY = 0.5


def markers(stamp_ns: int, frame_id: str, boxes: Boxes) -> Any:
    """One cube for each box in that frame, coloured by class, after a marker that clears the old ones."""
    Marker = message_class("visualization_msgs/msg/Marker")
    clear = _marker(stamp_ns, frame_id, action=Marker.DELETEALL)
    cubes = [
        _marker(
            stamp_ns,
            frame_id,
            action=Marker.ADD,
            type=Marker.CUBE,
            ns=CLASSES[label],
            id=number,
            pose=box_pose(box),
            scale=vector3(box[3:6]),
            color=_colour(CLASSES[label]),
        )
        for number, (box, label) in enumerate(zip(boxes.geometry, boxes.labels, strict=True))
    ]
    return message_class("visualization_msgs/msg/MarkerArray")(markers=[clear, *cubes])


@cache
def _colour(class_name: str) -> Any:
    red, green, blue = CLASS_COLOURS_RGB[class_name]
    return message_class("std_msgs/msg/ColorRGBA")(r=red, g=green, b=blue, a=OPACITY)


def _marker(stamp_ns: int, frame_id: str, **values: Any) -> Any:
    parts = {**_defaults(), "header": header(stamp_ns, frame_id), **values}
    return message_class("visualization_msgs/msg/Marker")(**parts)


@cache
def _defaults() -> dict[str, Any]:
    """What no marker of ours uses; made once, since there are many markers."""
    empty_image = message_class("sensor_msgs/msg/CompressedImage")(
        header=header(0, ""), format="", data=np.zeros(0, np.uint8)
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
