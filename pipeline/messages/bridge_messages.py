"""Messages as CARLA's ROS bridge publishes them, where its types or fields differ from ours.

Its images are raw, ours compressed; its radar points have names and angles of their own.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.messages.radar import RADAR_POINT_DTYPE
from advpipe.pipeline.messages.types import message_class, serialise, typestore

COMPRESSED_IMAGE, IMAGE = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"
POINTS = "sensor_msgs/msg/PointCloud2"

FLOAT32 = 7
RADAR_FIELDS = ("x", "y", "z", "Range", "Velocity", "AzimuthAngle", "ElevationAngle")

HEAD_BYTES = 512
"""The fields of a cloud are described before here."""


def bridge_type(type_name: str) -> str:
    """The type of the bridge's topic for one of ours."""
    return IMAGE if type_name == COMPRESSED_IMAGE else type_name


def bridge_message(type_name: str, cdr: bytes) -> bytes:
    """A serialised message of ours as the bridge would send it. Raises AdvpipeError for a malformed one."""
    convert = _CONVERSIONS.get(type_name)
    if convert is None:
        return cdr
    try:
        return convert(cdr)
    except Exception as error:  # whatever rosbags and Pillow raise of bytes from anywhere
        raise AdvpipeError(f"malformed {type_name} message: {one_line(error)}") from None


def _raw_image(cdr: bytes) -> bytes:
    """Colours as bgra8; depth in metres as 32FC1, infinite where ours has none (REP 118)."""
    from PIL import Image

    ours: Any = typestore().deserialize_cdr(cdr, COMPRESSED_IMAGE)
    pixels = np.asarray(Image.open(io.BytesIO(bytes(ours.data))))
    if pixels.ndim == 2:
        data = np.where(pixels > 0, pixels / np.float32(1000), np.inf).astype("<f4")
        encoding = "32FC1"
    else:
        data = np.full((*pixels.shape[:2], 4), 255, np.uint8)
        data[:, :, :3] = pixels[:, :, ::-1]
        encoding = "bgra8"
    height, width = pixels.shape[:2]
    image = message_class(IMAGE)(
        header=ours.header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=4 * width,
        data=np.frombuffer(data.tobytes(), np.uint8),
    )
    return serialise(image, IMAGE)


def _points(cdr: bytes) -> bytes:
    """A radar's points with the bridge's fields, azimuth to the right as CARLA has it; others as they are."""
    if b"velocity" not in cdr[:HEAD_BYTES]:
        return cdr
    ours: Any = typestore().deserialize_cdr(cdr, POINTS)
    if ours.point_step != RADAR_POINT_DTYPE.itemsize:
        return cdr
    points = np.frombuffer(ours.data.tobytes(), RADAR_POINT_DTYPE)
    x, y, z = (points[axis].astype(np.float64) for axis in "xyz")
    level_m = np.hypot(x, y)
    columns = (x, y, z, np.hypot(level_m, z), points["velocity"], -np.arctan2(y, x), np.arctan2(z, level_m))
    field = message_class("sensor_msgs/msg/PointField")
    data = np.stack(columns, axis=1).astype("<f4").tobytes()
    step = 4 * len(RADAR_FIELDS)
    cloud = message_class(POINTS)(
        header=ours.header,
        height=1,
        width=len(points),
        fields=[field(name, 4 * place, FLOAT32, 1) for place, name in enumerate(RADAR_FIELDS)],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(points),
        data=np.frombuffer(data, np.uint8),
        is_dense=True,
    )
    return serialise(cloud, POINTS)


_CONVERSIONS: dict[str, Callable[[bytes], bytes]] = {COMPRESSED_IMAGE: _raw_image, POINTS: _points}
