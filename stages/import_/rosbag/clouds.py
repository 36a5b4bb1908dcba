"""Clouds of ROS messages, in the layouts of many drivers."""

from __future__ import annotations

from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.import_.point_fields import MOST_POINTS, Array, cloud_of_fields

POINT_CLOUD2 = "sensor_msgs/msg/PointCloud2"
LIVOX_TYPES = ("livox_ros_driver/msg/CustomMsg", "livox_ros_driver2/msg/CustomMsg")
CLOUD_TYPES = (POINT_CLOUD2, *LIVOX_TYPES)

_FIELD_CODES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Of sensor_msgs/PointField."""

_LIVOX_FIELDS = {"x": "f4", "y": "f4", "z": "f4", "reflectivity": "u1", "line": "u1", "offset_time": "u4"}


def cloud_of_message(message: Any, type_name: str, stamp_ns: int, scale_intensity: float) -> Cloud:
    """The points of a sensor_msgs/PointCloud2 or of Livox's CustomMsg. Raises AdvpipeError."""
    try:
        fields = _livox_fields(message) if type_name in LIVOX_TYPES else _fields(message)
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise AdvpipeError(f"its fields do not fit its data: {error}") from None
    return cloud_of_fields(fields, stamp_ns, scale_intensity)


def _fields(message: Any) -> dict[str, Array]:
    height, width = int(message.height), int(message.width)
    point_bytes, row_bytes, data = int(message.point_step), int(message.row_step), message.data
    if height * width > MOST_POINTS:
        raise AdvpipeError(f"it has {height * width:,} points; a cloud has at most {MOST_POINTS:,}")
    row_bytes = row_bytes or width * point_bytes  # some drivers leave it out
    if row_bytes < width * point_bytes or len(data) < height * row_bytes:
        raise ValueError(f"{height} x {width} points of {point_bytes} bytes in {len(data)} bytes")
    order = ">" if message.is_bigendian else "<"
    rows = np.frombuffer(data, np.uint8, height * row_bytes).reshape(height, row_bytes)
    points = np.ascontiguousarray(rows[:, : width * point_bytes]).reshape(height * width, point_bytes)
    fields = {}
    for each in message.fields:
        code = _FIELD_CODES.get(each.datatype)
        if code is None or each.count > 1:
            continue
        end = each.offset + np.dtype(code).itemsize
        if end > point_bytes:
            raise ValueError(f"the field {each.name[:40]!r} ends at byte {end} of {point_bytes}")
        column = np.ascontiguousarray(points[:, each.offset : end])
        fields[each.name] = column.view(order + code).reshape(-1)
    return fields


def _livox_fields(message: Any) -> dict[str, Array]:
    return {
        name: np.array([getattr(point, name) for point in message.points], code)
        for name, code in _LIVOX_FIELDS.items()
    }
