"""V2X messages of a drive: the positions of the radios, the transmissions, and the receptions of a vehicle.

They are written field by field, since there are some hundred in each step.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, quaternion_of_rows
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cam_cdr import message_cdr
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.messages.topics import (
    V2X_PACKETS,
    V2X_PSEUDONYMS,
    V2X_SENT,
    V2X_STATIONS,
    VehicleTopics,
)
from advpipe.pipeline.v2x.channel import Received, Rejected, Sent
from advpipe.pipeline.v2x.codec.btp import btp_packet
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.message_codec import MessageTree
from advpipe.pipeline.v2x.message_type import MessageType, message_type_of
from advpipe.pipeline.v2x.radio.stations import Int64, Stations
from advpipe.pipeline.v2x.radio.vehicle_loss import Bodies
from advpipe.pipeline.v2x.section import V2x


class RadioPlace(NamedTuple):
    """A radio on the road, with its vehicle's pose on the ground (4, 4), size (3,) and velocity (3,)."""

    station_id: int
    vehicle: str
    map_SE3_base: Float64
    size_m: tuple[float, float, float]
    velocity_mps: Float64


class RadioPlaces(tuple[RadioPlace, ...]):
    """The radios of one message, whose ids (S,) and poses (S, 4, 4) are arrays as well."""

    ids: Int64
    poses: Float64

    def __new__(cls, places: Iterable[RadioPlace], poses: Float64) -> RadioPlaces:
        """poses: those of the places, in their order."""
        radios = super().__new__(cls, places)
        radios.ids, radios.poses = np.array([place.station_id for place in radios], np.int64), poses
        return radios


class PseudonymUse(NamedTuple):
    """A station's radio that calls itself otherwise from this time on."""

    time_ns: int
    station_id: int
    pseudonym: int


def stations_of(v2x: V2x, places: Sequence[RadioPlace]) -> Stations:
    """The stations for the radio medium, with their antennas above the centres of their vehicles.

    The vehicles have bodies where `v2x.radio.vehicle_loss` makes them obstacles.
    """
    if isinstance(places, RadioPlaces):
        ids, poses = places.ids, places.poses
    else:
        ids = np.array([place.station_id for place in places], np.int64)
        poses = np.frombuffer(b"".join([place.map_SE3_base.tobytes() for place in places])).reshape(-1, 4, 4)
    bodies = None if v2x.radio.vehicle_loss == "none" else _bodies(places, poses)
    return Stations(ids, poses[:, :3, 3] + (0.0, 0.0, v2x.radio.antenna_height_m), bodies)


def _bodies(places: Sequence[RadioPlace], poses: Float64) -> Bodies:
    size_m = np.array([place.size_m for place in places], np.float64).reshape(-1, 3)
    forward = poses[:, :2, 0] / np.linalg.norm(poses[:, :2, 0], axis=1, keepdims=True)
    return Bodies(poses[:, :2, 3], forward, size_m[:, :2] / 2, poses[:, 2, 3] + size_m[:, 2])


def stations_message(stamp_ns: int, stations: Sequence[RadioPlace], frame_id: str = "map") -> StampedCdr:
    """advpipe_msgs/V2xStationArray, serialised, with its topic and stamp."""
    cdr = Cdr()
    cdr.header(stamp_ns, frame_id)
    cdr.uint32(len(stations))
    for station in stations:
        pose = station.map_SE3_base.tolist()
        cdr.uint32(station.station_id)
        cdr.string(station.vehicle)
        cdr.float64(
            *(row[3] for row in pose[:3]),
            *quaternion_of_rows(pose),
            *station.size_m,
            *station.velocity_mps.tolist(),
        )
    return V2X_STATIONS, bytes(cdr), stamp_ns


def stations_of_message(message: Any) -> RadioPlaces:
    """The radios in a recorded message; their positions are exact."""
    poses = build.se3_from_poses([station.pose for station in message.stations])
    places = (
        RadioPlace(
            station.station_id,
            station.vehicle,
            map_SE3_base,
            (station.size.x, station.size.y, station.size.z),
            np.array([station.velocity.x, station.velocity.y, station.velocity.z]),
        )
        for station, map_SE3_base in zip(message.stations, poses, strict=True)
    )
    return RadioPlaces(places, poses)


def sent_message(sent: Sent) -> StampedCdr:
    """advpipe_msgs/V2xTransmission, serialised, with its topic and stamp."""
    cdr = Cdr()
    cdr.header(sent.request_ns, "")
    cdr.uint64(sent.number)
    cdr.uint32(sent.station_id)
    cdr.uint64(sent.key)
    cdr.float64(sent.power_dbm)
    cdr.octets(sent.payload)
    return V2X_SENT, bytes(cdr), sent.request_ns


def packet_messages(sent: Sent) -> Iterator[StampedCdr]:
    """Yield advpipe_msgs/V2xPacket, serialised, if the drive's messages have packets."""
    if sent.packet:
        cdr = Cdr()
        cdr.header(sent.request_ns, "")
        cdr.uint64(sent.number)
        cdr.octets(sent.packet)
        yield V2X_PACKETS, bytes(cdr), sent.request_ns


def pseudonym_message(change: PseudonymUse) -> StampedCdr:
    """advpipe_msgs/V2xPseudonym, serialised, with its topic and stamp."""
    cdr = Cdr()
    cdr.header(change.time_ns, "")
    cdr.uint32(change.station_id)
    cdr.uint32(change.pseudonym)
    return V2X_PSEUDONYMS, bytes(cdr), change.time_ns


def rejected_message(rejected: Rejected) -> StampedCdr:
    """advpipe_msgs/V2xRejection, serialised, with its topic and stamp."""
    cdr = Cdr()
    cdr.header(rejected.arrival_ns, "")
    cdr.uint64(rejected.sent.number)
    cdr.uint32(rejected.sent.station_id)
    cdr.string(rejected.rejection.value)
    return VehicleTopics(rejected.listener).rejections, bytes(cdr), rejected.arrival_ns


def sent_of_message(message: Any) -> Sent:
    """The transmission in a recorded message."""
    return Sent(
        message.number,
        message.key,
        message.station_id,
        build.stamp_ns(message),
        bytes(message.payload),
        message.power,
    )


def own_messages(topics: VehicleTopics, sent: Sent) -> Iterator[StampedCdr]:
    """Yield the messages for a vehicle's own transmission: its bytes, and its values if it is valid."""
    kind = message_type_of(sent.payload)
    try:
        tree = kind.codec.decode(sent.payload)
    except MessageError:
        tree = None
    values = topics.sent_values(kind)
    yield from _packet(topics.sent_raw, values, kind, sent.payload, tree, sent.request_ns)


def received_messages(received: Received) -> Iterator[StampedCdr]:
    """Yield the messages for one reception: its bytes, its values if it is valid, its power and SINR, and the
    true transmission."""
    raw, info, truth = _topics_received(received.listener)
    kind = message_type_of(received.sent.payload)
    values = _values_received(received.listener, kind)
    yield from _packet(raw, values, kind, received.sent.payload, received.tree, received.arrival_ns)
    yield info, _reception_info_cdr(received), received.arrival_ns
    sent = received.sent
    yield truth, reception_cdr(received.arrival_ns, sent.number, sent.station_id), received.arrival_ns


@cache
def _topics_received(vehicle: str) -> tuple[Topic, Topic, Topic]:
    topics = VehicleTopics(vehicle)
    return topics.received_raw, topics.reception_info, topics.true_receptions


@cache
def _values_received(vehicle: str, kind: MessageType) -> Topic:
    return VehicleTopics(vehicle).received_values(kind)


def _reception_info_cdr(received: Received) -> bytes:
    """advpipe_msgs/V2xReceptionInfo, serialised."""
    cdr = Cdr()
    cdr.header(received.arrival_ns, "")
    cdr.float64(received.power_dbm, received.sinr_db)
    return bytes(cdr)


def reception_cdr(arrival_ns: int, number: int, station_id: int) -> bytes:
    """advpipe_msgs/V2xReception, serialised: which message of which station truly was received."""
    cdr = Cdr()
    cdr.header(arrival_ns, "")
    cdr.uint64(number)
    cdr.uint32(station_id)
    return bytes(cdr)


def udp_packet_cdr(stamp_ns: int, payload: bytes) -> bytes:
    """udp_msgs/UdpPacket, serialised, as the etsi_its_conversion node reads it: BTP-B, then the message."""
    cdr = Cdr()
    cdr.header(stamp_ns, "")
    cdr.string("")
    cdr.uint16(0)
    cdr.octets(btp_packet(payload, message_type_of(payload).port))
    return bytes(cdr)


def _packet(
    raw: Topic, values: Topic, kind: MessageType, payload: bytes, tree: MessageTree | None, stamp_ns: int
) -> Iterator[StampedCdr]:
    yield raw, udp_packet_cdr(stamp_ns, payload), stamp_ns
    if tree is not None:
        try:
            cdr = message_cdr(kind, tree)
        except MessageError:  # one of a later release, with a value that the message cannot hold
            return
        yield values, cdr, stamp_ns
