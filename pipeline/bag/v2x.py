"""Messages of a drive's V2X: what every station sent, where the radios were, and what one vehicle heard."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.cam_message import cam_cdr, udp_packet
from advpipe.pipeline.bag.topics import V2X_SENT, V2X_STATIONS, Topic, VehicleTopics
from advpipe.pipeline.bag.types import message_class, serialise
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.air import Received, Sent
from advpipe.pipeline.v2x.ldm import Verdict

StampedCdr = tuple[Topic, bytes, int]
"""A topic, a serialised message for it, and its stamp in nanoseconds."""


class RadioPlace(NamedTuple):
    """A radio on the road: its vehicle's pose on the ground (4, 4), size (3,) and velocity (3,)."""

    station_id: int
    vehicle: str
    map_SE3_base: Float64
    size_m: tuple[float, float, float]
    velocity_mps: Float64


def stations_message(stamp_ns: int, stations: Sequence[RadioPlace], frame_id: str = "map") -> StampedCdr:
    """advpipe_msgs/V2xStationArray."""
    Station = message_class("advpipe_msgs/msg/V2xStation")
    message = message_class(V2X_STATIONS.type)(
        header=messages.header(stamp_ns, frame_id),
        stations=[
            Station(
                station_id=station.station_id,
                vehicle=station.vehicle,
                pose=messages.pose(station.map_SE3_base),
                size=messages.vector3(station.size_m),
                velocity=messages.vector3(station.velocity_mps),
            )
            for station in stations
        ],
    )
    return V2X_STATIONS, serialise(message, V2X_STATIONS.type), stamp_ns


def sent_message(sent: Sent) -> StampedCdr:
    """advpipe_msgs/V2xTransmission."""
    message = message_class(V2X_SENT.type)(
        header=messages.header(sent.request_ns, ""),
        number=sent.number,
        station_id=sent.station_id,
        key=sent.key,
        power=sent.power_dbm,
        payload=np.frombuffer(sent.payload, np.uint8),
    )
    return V2X_SENT, serialise(message, V2X_SENT.type), sent.request_ns


def sent_of_message(message: Any) -> Sent:
    """The transmission that a recorded message tells of."""
    return Sent(
        message.number,
        message.key,
        message.station_id,
        messages.stamp_ns(message),
        bytes(message.payload),
        message.power,
    )


def own_messages(topics: VehicleTopics, sent: Sent) -> Iterator[StampedCdr]:
    """What a vehicle sends, as its own radio shows it: bytes and values."""
    yield from _packet(topics.sent_raw, topics.sent_cam, sent.payload, sent.request_ns, is_cam=True)


def received_messages(topics: VehicleTopics, received: Received) -> Iterator[StampedCdr]:
    """What a vehicle receives: the bytes always, the values where they are a CAM's."""
    is_cam = received.verdict is not Verdict.CORRUPT
    payload, arrival_ns = received.sent.payload, received.arrival_ns
    yield from _packet(topics.received_raw, topics.received_cam, payload, arrival_ns, is_cam=is_cam)


def _packet(raw: Topic, cam: Topic, payload: bytes, stamp_ns: int, *, is_cam: bool) -> Iterator[StampedCdr]:
    yield raw, serialise(udp_packet(stamp_ns, payload), raw.type), stamp_ns
    if is_cam:
        yield cam, cam_cdr(payload), stamp_ns
