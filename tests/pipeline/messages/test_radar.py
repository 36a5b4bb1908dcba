"""Radar scans as messages: the bytes that rosbags writes, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import message_header
from advpipe.pipeline.messages.radar import (
    RADAR_POINT_DTYPE,
    RETURN_DTYPE,
    SCAN_TYPE,
    radar_cloud_to_cdr,
    scan_from_cdr,
    scan_to_cdr,
)
from advpipe.pipeline.messages.types import message_class, serialise, type_hash, typestore

STAMP_NS = 1_700_000_000_123_456_789


def returns_of(*rows: tuple[float, ...]) -> np.ndarray:
    return np.array(list(rows), RETURN_DTYPE)


SCAN = returns_of((40.0, 0.1, -0.02, -12.5, 31.0), (80.5, -0.2, 0.0, 3.0, 14.5))


@pytest.mark.parametrize("frame_id", ["ego/front", "ego/a", "x"])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_the_bytes_are_those_of_rosbags(frame_id: str, count: int) -> None:
    item = message_class("radar_msgs/msg/RadarReturn")
    items = [item(*map(float, one)) for one in SCAN[:count].tolist()]
    message = message_class(SCAN_TYPE)(message_header(STAMP_NS, frame_id), items)
    cdr = scan_to_cdr(SCAN[:count], STAMP_NS, frame_id)
    assert cdr == serialise(message, SCAN_TYPE)
    read = scan_from_cdr(cdr)
    assert (read.stamp_ns, read.frame_id, read.returns.tobytes()) == (
        STAMP_NS,
        frame_id,
        SCAN[:count].tobytes(),
    )


def test_the_type_is_that_of_the_package() -> None:
    fields = typestore().fielddefs["radar_msgs/msg/RadarReturn"][1]
    assert [name for name, _ in fields] == ["range", "azimuth", "elevation", "doppler_velocity", "amplitude"]
    assert type_hash(SCAN_TYPE).startswith("RIHS01_")


def test_points_have_velocity_and_rcs() -> None:
    cdr = radar_cloud_to_cdr(SCAN, [10.0, -3.0], STAMP_NS, "ego/front")
    message = typestore().deserialize_cdr(cdr, "sensor_msgs/msg/PointCloud2")
    assert [field.name for field in message.fields] == list(RADAR_POINT_DTYPE.names or ())
    points = np.frombuffer(message.data.tobytes(), RADAR_POINT_DTYPE)
    assert points["velocity"].tolist() == [-12.5, 3.0]
    assert points["rcs"].tolist() == [10.0, -3.0]
    range_m = np.sqrt(points["x"] ** 2 + points["y"] ** 2 + points["z"] ** 2)
    assert range_m == pytest.approx([40.0, 80.5], rel=1e-6)


@pytest.mark.parametrize(
    "damage",
    [
        lambda cdr: cdr[:-1],
        lambda cdr: cdr + b"\0",
        lambda cdr: b"\0\0" + cdr[2:],
        lambda cdr: cdr[:12] + b"\xff\xff\xff\x7f" + cdr[16:],
        lambda cdr: cdr[:-4] + np.float32(np.nan).tobytes(),
        lambda cdr: cdr[:-4] + np.float32(1e30).tobytes(),
        lambda cdr: b"",
    ],
)
def test_damaged_messages_are_refused(damage: object) -> None:
    with pytest.raises(AdvpipeError, match="malformed RadarScan"):
        scan_from_cdr(damage(scan_to_cdr(SCAN, STAMP_NS, "ego/front")))  # type: ignore[operator]
