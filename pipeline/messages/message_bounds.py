"""Checks untrusted messages before their values are used: types of topics, finite numbers, rotations, names.

Types that are not listed here are not used in computations, or have their own bounded reader (`cloud.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from advpipe.pipeline.messages.topics import (
    SCENARIO_INFO,
    TF,
    TF_STATIC,
    V2X_BUILDINGS,
    V2X_SENT,
    V2X_STATIONS,
    V2X_STATISTICS,
)
from advpipe.pipeline.v2x.codec.btp import HEADER_BYTES

LONGEST_NAME = 255
FARTHEST_M = 1e7
"""Largest distance from the map's origin: a quarter of the Earth's circumference."""
FASTEST = 1e5
"""Largest speed in m/s, angular rate in rad/s and acceleration in m/s²."""
LARGEST_M = 1e4
"""Largest dimension of a road user's box."""
MOST_PAYLOAD_BYTES = 1 << 16
MOST_PACKET_BYTES = MOST_PAYLOAD_BYTES + 1024
"""A payload with all headers and a security envelope."""
_STRONGEST_DBM = 200.0
_MOST_PLANES = 1000
_LARGEST_PLANE = 1e12
_MOST_PIXELS = 1e6
LATEST_NS = ((1 << 31) - 86_400) * 1_000_000_000
"""One day before ROS time stamps end, in January 2038: attacks add delays to log times."""

_TYPES = {
    topic.name: topic.type
    for topic in (SCENARIO_INFO, TF, TF_STATIC, V2X_BUILDINGS, V2X_SENT, V2X_STATIONS, V2X_STATISTICS)
}

Problems = Iterator[str]


def implausibility(topic: str, type_name: str, message: Any) -> str:
    """The first problem of a decoded message, as the predicate of a sentence about it; "" if none."""
    expected = _TYPES.get(topic, type_name)
    if type_name != expected:
        return f"is a {type_name}, not a {expected}"
    check = _CHECKS.get(type_name)
    if check is None:
        return ""
    try:
        return next(check(message), "")
    except (AttributeError, TypeError, ValueError, ArithmeticError) as error:
        return f"cannot be interpreted: {error}"


def _finite(values: Iterable[float], limit: float, name: str) -> Problems:
    for value in values:
        if not abs(value) <= limit:  # NaN is refused, too
            yield f"has {name} {value:g}; at most {limit:g} is accepted"


def _name(text: str, what: str) -> Problems:
    if len(text) > LONGEST_NAME:
        yield f"has a {what} of {len(text)} characters"
    if "\0" in text:
        yield f"has a {what} with a NUL character"


def _header(header: Any) -> Problems:
    yield from _name(header.frame_id, "frame")
    if header.stamp.sec < 0 or header.stamp.nanosec >= 1_000_000_000:
        yield f"has the stamp {header.stamp.sec} s and {header.stamp.nanosec} ns"


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _rotation(q: Any) -> Problems:
    length = math.sqrt(sum(part * part for part in (q.x, q.y, q.z, q.w)))
    if not 1e-6 < length < 1e6:  # NaN is refused, too
        yield f"has the orientation {q.x:g}, {q.y:g}, {q.z:g}, {q.w:g}, which is not a rotation"


def _pose(pose: Any) -> Problems:
    yield from _finite(_xyz(pose.position), FARTHEST_M, "the position")
    yield from _rotation(pose.orientation)


def _size(size: Any) -> Problems:
    yield from _finite(_xyz(size), LARGEST_M, "the size")
    if min(_xyz(size)) < 0:
        yield f"has the size {min(_xyz(size)):g}, which is negative"


def _stations(message: Any) -> Problems:
    yield from _header(message.header)
    ids: set[int] = set()
    names: set[str] = set()
    for station in message.stations:
        yield from _name(station.vehicle, "station's name")
        if station.station_id in ids or station.vehicle in names:
            yield f"has the station {station.station_id} ({station.vehicle!r}) twice"
        ids.add(station.station_id)
        names.add(station.vehicle)
        yield from _pose(station.pose)
        yield from _size(station.size)
        yield from _finite(_xyz(station.velocity), FASTEST, "the velocity")


def _sent(message: Any) -> Problems:
    yield from _header(message.header)
    if message.number >= 2**63:
        yield f"has the number {message.number}"
    yield from _finite([message.power], _STRONGEST_DBM, "the power")
    if len(message.payload) > MOST_PAYLOAD_BYTES:
        yield f"has a payload of {len(message.payload)} bytes"


def _packet(message: Any) -> Problems:
    yield from _header(message.header)
    if len(message.data) > HEADER_BYTES + MOST_PAYLOAD_BYTES:
        yield f"has a payload of {len(message.data)} bytes"


def _pseudonym(message: Any) -> Problems:
    yield from _header(message.header)


def _v2x_packet(message: Any) -> Problems:
    yield from _reception(message)
    if len(message.data) > MOST_PACKET_BYTES:
        yield f"has a packet of {len(message.data)} bytes"


def _rejection(message: Any) -> Problems:
    yield from _reception(message)
    yield from _name(message.reason, "reason")


def _reception_info(message: Any) -> Problems:
    """Check power and SINR; NaN stands for a value that is not recorded."""
    yield from _header(message.header)
    recorded = (value for value in (message.power_dbm, message.sinr_db) if not math.isnan(value))
    yield from _finite(recorded, _STRONGEST_DBM, "the power or SINR")


def _reception(message: Any) -> Problems:
    yield from _header(message.header)
    if message.number >= 2**63:
        yield f"has the number {message.number}"


def _odometry(message: Any) -> Problems:
    yield from _header(message.header)
    yield from _name(message.child_frame_id, "frame")
    yield from _pose(message.pose.pose)
    twist = message.twist.twist
    yield from _finite((*_xyz(twist.linear), *_xyz(twist.angular)), FASTEST, "the velocity")


def _initial_pose(message: Any) -> Problems:
    yield from _header(message.header)
    yield from _pose(message.pose.pose)
    yield from _finite(message.pose.covariance.tolist(), FARTHEST_M**2, "the covariance")


def _transforms(message: Any) -> Problems:
    for transform in message.transforms:
        yield from _header(transform.header)
        yield from _name(transform.child_frame_id, "frame")
        yield from _finite(_xyz(transform.transform.translation), FARTHEST_M, "the translation")
        yield from _rotation(transform.transform.rotation)


def _imu(message: Any) -> Problems:
    yield from _header(message.header)
    parts = (*_xyz(message.linear_acceleration), *_xyz(message.angular_velocity))
    yield from _finite(parts, FASTEST, "the measurement")


def _fix(message: Any) -> Problems:
    """Check a fix; a position that is not finite is allowed, as from receivers without satellites."""
    yield from _header(message.header)
    position = (message.latitude, message.longitude, message.altitude)
    if all(map(math.isfinite, position)):
        yield from _finite(position[:1], 90.0, "the latitude")
        yield from _finite(position[1:2], 360.0, "the longitude")
        yield from _finite(position[2:], FARTHEST_M, "the altitude")
        yield from _finite(message.position_covariance.tolist(), FARTHEST_M**2, "the covariance")


def _detections(message: Any) -> Problems:
    yield from _header(message.header)
    for detection in message.detections:
        yield from _name(detection.id, "box's name")
        for result in detection.results:
            yield from _name(result.hypothesis.class_id, "class")
        yield from _finite(_xyz(detection.bbox.center.position), FARTHEST_M, "the position")
        q = detection.bbox.center.orientation
        yield from _finite((q.x, q.y, q.z, q.w), 1e6, "the orientation")
        yield from _size(detection.bbox.size)


def _objects(message: Any) -> Problems:
    yield from _header(message.header)
    for each in message.objects:
        yield from _finite(_xyz(each.pose.position), FARTHEST_M, "the position")
        yield from _finite(each.shape.dimensions, LARGEST_M, "the size")


def _road_users(message: Any) -> Problems:
    yield from _header(message.header)
    for user in message.road_users:
        yield from _name(user.id, "road user's name")
        yield from _name(user.class_id, "class")
        yield from _pose(user.pose)
        yield from _size(user.size)
        velocity = _xyz(user.velocity)
        yield from _finite((v for v in velocity if not math.isnan(v)), FASTEST, "the velocity")
        yield from _finite((v for v in [user.occlusion] if not math.isnan(v)), 1.0, "the occlusion")


def _heard_objects(message: Any) -> Problems:
    yield from _header(message.header)
    for each in message.objects:
        yield from _name(each.class_id, "class")
        yield from _finite(_xyz(each.centre), FARTHEST_M, "the position")
        values = (each.velocity_x, each.velocity_y, each.yaw, each.length, each.width, each.height)
        yield from _finite((value for value in values if not math.isnan(value)), FASTEST, "a value")


def _label_coverage(message: Any) -> Problems:
    yield from _header(message.header)
    for region in (*message.labelled, *message.ignored):
        yield from _name(region.name, "region's name")
        if len(region.planes) % 4 or len(region.planes) > 4 * _MOST_PLANES:
            yield f"has a region of {len(region.planes)} numbers, not 4 for each plane"
        yield from _finite((*region.planes.tolist(), region.max_range), _LARGEST_PLANE, "the region")


def _image_labels(message: Any) -> Problems:
    yield from _header(message.header)
    for label in message.labels:
        yield from _name(label.id, "label's name")
        yield from _name(label.class_id, "class")
        numbers = (
            label.left,
            label.top,
            label.right,
            label.bottom,
            label.truncation,
            label.observation_angle,
        )
        yield from _finite(numbers, _MOST_PIXELS, "the image label")


def _camera_info(message: Any) -> Problems:
    yield from _header(message.header)
    yield from _finite(
        (*message.k.tolist(), *message.r.tolist(), *message.p.tolist()), FARTHEST_M, "a matrix"
    )


def _text(message: Any) -> Problems:
    if "\0" in message.data:
        yield "has a text with a NUL character"


_CHECKS: dict[str, Callable[[Any], Problems]] = {
    "advpipe_msgs/msg/HeardObjectArray": _heard_objects,
    "advpipe_msgs/msg/ImageLabelArray": _image_labels,
    "advpipe_msgs/msg/LabelCoverage": _label_coverage,
    "advpipe_msgs/msg/RoadUserArray": _road_users,
    "advpipe_msgs/msg/V2xPacket": _v2x_packet,
    "advpipe_msgs/msg/V2xPseudonym": _pseudonym,
    "advpipe_msgs/msg/V2xReception": _reception,
    "advpipe_msgs/msg/V2xReceptionInfo": _reception_info,
    "advpipe_msgs/msg/V2xRejection": _rejection,
    "advpipe_msgs/msg/V2xStationArray": _stations,
    "advpipe_msgs/msg/V2xTransmission": _sent,
    "derived_object_msgs/msg/ObjectArray": _objects,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _initial_pose,
    "nav_msgs/msg/Odometry": _odometry,
    "sensor_msgs/msg/CameraInfo": _camera_info,
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _fix,
    "std_msgs/msg/String": _text,
    "tf2_msgs/msg/TFMessage": _transforms,
    "udp_msgs/msg/UdpPacket": _packet,
    "vision_msgs/msg/Detection3DArray": _detections,
}
