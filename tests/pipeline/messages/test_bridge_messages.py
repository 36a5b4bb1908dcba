"""Messages as CARLA's ROS bridge has them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.bridge_messages import (
    COMPRESSED_IMAGE,
    IMAGE,
    POINTS,
    bridge_message,
    bridge_type,
)
from advpipe.pipeline.messages.cloud import POINT_DTYPE, points_to_cdr
from advpipe.pipeline.messages.images import jpeg_message, png_message
from advpipe.pipeline.messages.radar import RETURN_DTYPE, radar_cloud_to_cdr
from advpipe.pipeline.messages.types import serialise, typestore


def converted(type_name: str, cdr: bytes) -> Any:
    return typestore().deserialize_cdr(bridge_message(type_name, cdr), bridge_type(type_name))


def test_colours_are_bgra8() -> None:
    picture = np.zeros((16, 24, 3), np.uint8)
    picture[:, :, 0] = 200
    for message in (jpeg_message(5, "ego/c", picture, 100), png_message(5, "ego/c", picture)):
        image = converted(COMPRESSED_IMAGE, serialise(message, COMPRESSED_IMAGE))
        assert (image.height, image.width, image.step, image.encoding) == (16, 24, 96, "bgra8")
        assert image.header == message.header
        pixels = image.data.reshape(16, 24, 4)
        assert pixels[8, 8] == pytest.approx([0, 0, 200, 255], abs=3)
    assert bridge_type(COMPRESSED_IMAGE) == IMAGE


def test_depth_is_in_metres() -> None:
    """REP 118: infinite where nothing is near enough."""
    depth_mm = np.array([[1500, 0], [65_535, 1]], np.uint16)
    image = converted(COMPRESSED_IMAGE, serialise(png_message(5, "ego/c", depth_mm), COMPRESSED_IMAGE))
    assert (image.encoding, image.step) == ("32FC1", 8)
    assert image.data.view("<f4").tolist() == pytest.approx([1.5, np.inf, 65.535, 0.001])


def test_radar_points_have_the_bridges_fields() -> None:
    """The bridge keeps CARLA's azimuth, which is positive to the right, beside right-handed coordinates."""
    returns = np.array([(20.0, 0.3, -0.1, -4.0, 30.0)], RETURN_DTYPE)
    cloud = converted(POINTS, radar_cloud_to_cdr(returns, [0.0], 5, "ego/radar"))
    fields = [(one.name, one.offset, one.datatype) for one in cloud.fields]
    assert fields[3:] == [
        ("Range", 12, 7), ("Velocity", 16, 7), ("AzimuthAngle", 20, 7), ("ElevationAngle", 24, 7)
    ]  # fmt: skip
    x, y, z, range_m, velocity, azimuth, elevation = cloud.data.view("<f4").tolist()
    assert (range_m, velocity, azimuth, elevation) == pytest.approx((20, -4, -0.3, -0.1), abs=1e-5)
    assert y > 0
    assert x == pytest.approx(20 * np.cos(0.1) * np.cos(0.3), abs=1e-4)
    assert z == pytest.approx(-20 * np.sin(0.1), abs=1e-4)


def test_a_damaged_picture_costs_one_line() -> None:
    message = jpeg_message(5, "ego/c", np.zeros((16, 24, 3), np.uint8), 90)
    whole = serialise(message, COMPRESSED_IMAGE)
    message.data = message.data[:40]
    for damaged in (serialise(message, COMPRESSED_IMAGE), whole[:-9], whole[:10]):
        with pytest.raises(AdvpipeError, match=r"malformed sensor_msgs/msg/CompressedImage message: .+"):
            bridge_message(COMPRESSED_IMAGE, damaged)


def test_other_clouds_and_messages_stay() -> None:
    cdr = points_to_cdr(np.zeros(50, POINT_DTYPE), 5, "ego/lidar")
    assert bridge_message(POINTS, cdr) is cdr
    assert bridge_message("std_msgs/msg/String", b"x") == b"x"
    assert bridge_type("sensor_msgs/msg/Imu") == "sensor_msgs/msg/Imu"
