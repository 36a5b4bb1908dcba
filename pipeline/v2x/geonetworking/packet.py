"""Single-hop and geographical broadcasts of GeoNetworking, secured or not (EN 302 636-4-1 v1.4.1, 9.6, 9.8).

A packet is its basic header, and then the common header, the extended header and BTP, as they are or
inside a security envelope. In an Ethernet frame of type 0x8947, Wireshark reads it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.geonetworking.position_vector import VECTOR_BYTES, LongPositionVector
from advpipe.pipeline.v2x.message_type import CAM

ETHERTYPE = 0x8947
BASIC_BYTES, COMMON_BYTES, MEDIA_BYTES = 4, 8, 4
SHB_BYTES = COMMON_BYTES + VECTOR_BYTES + MEDIA_BYTES
"""From the common header to the end of the extended one."""
GBC_BYTES = COMMON_BYTES + 4 + VECTOR_BYTES + 16
"""The same of a geographical broadcast."""

VERSION = 1
NEXT_COMMON, NEXT_SECURED = 1, 2
"""What follows the basic header."""
NEXT_BTP_B = 2
SINGLE_HOP_BROADCAST = 0x50
GEO_BROADCAST_CIRCLE = 0x40
MOBILE = 0x80
LIFETIME_1_S = 0x05
"""Multiplier 1, base 1 s."""
MAX_PACKET_BYTES = 1500

_BASIC = struct.Struct(">BBBB")
_COMMON = struct.Struct(">BBBBHBB")
_AREA = struct.Struct(">iiHHHH")
_BROADCAST = b"\xff" * 6


class PacketError(AdvpipeError):
    """The bytes are not a GeoNetworking packet that advpipe reads."""


class BasicPacket(NamedTuple):
    """A packet after its basic header. content: from the common header on, or a security envelope."""

    is_secured: bool
    content: bytes


class Area(NamedTuple):
    """The circle to which a message is broadcast: its centre in 1e-7 degrees, its radius in metres."""

    latitude: int
    longitude: int
    radius_m: int


class BroadcastPacket(NamedTuple):
    """The content of a broadcast. btp: the BTP-B header and what follows it. area: None for a single hop.

    number: counts a sender's geographical broadcasts.
    """

    sender: LongPositionVector
    btp: bytes
    area: Area | None = None
    number: int = 0


def broadcast_content(
    sender: LongPositionVector, btp: bytes, traffic_class: int = CAM.traffic_class
) -> bytes:
    """The common header, the extended header of a single-hop broadcast, and a BTP-B packet.

    traffic_class: of the type of message.

    The media-dependent data (channel load and power, for multi-hop congestion control) are 0.
    """
    common = _COMMON.pack(NEXT_BTP_B << 4, SINGLE_HOP_BROADCAST, traffic_class, MOBILE, len(btp), 1, 0)
    return common + sender.encode() + bytes(MEDIA_BYTES) + btp


def area_broadcast_content(
    sender: LongPositionVector, btp: bytes, traffic_class: int, area: Area, number: int
) -> bytes:
    """The common header, the extended header of a geographical broadcast, and a BTP-B packet.

    It has one hop: nobody forwards it. number: counts the sender's broadcasts, modulo 2^16.
    """
    common = _COMMON.pack(NEXT_BTP_B << 4, GEO_BROADCAST_CIRCLE, traffic_class, MOBILE, len(btp), 1, 0)
    place = _AREA.pack(area.latitude, area.longitude, area.radius_m, 0, 0, 0)
    return common + struct.pack(">HH", number % 2**16, 0) + sender.encode() + place + btp


def geonetworking_packet(content: bytes, is_secured: bool = False) -> bytes:
    """A packet of one hop: the basic header, then the content."""
    following = NEXT_SECURED if is_secured else NEXT_COMMON
    return _BASIC.pack(VERSION << 4 | following, 0, LIFETIME_1_S, 1) + content


def parse_packet(data: bytes) -> BasicPacket:
    """Split off the basic header. Raises PacketError for another version or kind of packet."""
    if len(data) < BASIC_BYTES:
        raise PacketError(f"{len(data)} bytes are too few for a GeoNetworking header of {BASIC_BYTES}")
    version, following = data[0] >> 4, data[0] & 0x0F
    if version != VERSION or following not in (NEXT_COMMON, NEXT_SECURED):
        raise PacketError(
            f"a packet of GeoNetworking version {version} with next header {following} is none of version "
            f"{VERSION}, {NEXT_COMMON} (plain) or {NEXT_SECURED} (secured)"
        )
    return BasicPacket(following == NEXT_SECURED, bytes(data[BASIC_BYTES:]))


def parse_broadcast(content: bytes) -> BroadcastPacket:
    """Split the content of a broadcast with BTP-B. Raises PacketError for any other."""
    if len(content) < SHB_BYTES:
        raise PacketError(f"{len(content)} bytes are too few for a single-hop broadcast of {SHB_BYTES}")
    following, header_type, _, _, payload_bytes, _, _ = _COMMON.unpack_from(content)
    if header_type not in (SINGLE_HOP_BROADCAST, GEO_BROADCAST_CIRCLE) or following >> 4 != NEXT_BTP_B:
        raise PacketError(
            f"header type 0x{header_type:02x} with next header {following >> 4} is no single-hop broadcast "
            "of BTP-B, nor one to a circle"
        )
    is_single_hop = header_type == SINGLE_HOP_BROADCAST
    btp = content[SHB_BYTES if is_single_hop else GBC_BYTES :]
    if len(btp) != payload_bytes:
        raise PacketError(f"{len(btp)} bytes follow the headers, which announce {payload_bytes}")
    begin = COMMON_BYTES if is_single_hop else COMMON_BYTES + 4
    sender = LongPositionVector.decode(content[begin : begin + VECTOR_BYTES])
    if is_single_hop:
        return BroadcastPacket(sender, bytes(btp))
    (number,) = struct.unpack_from(">H", content, COMMON_BYTES)
    latitude, longitude, radius_m, *_ = _AREA.unpack_from(content, begin + VECTOR_BYTES)
    return BroadcastPacket(sender, bytes(btp), Area(latitude, longitude, radius_m), number)


def ethernet_frame(packet: bytes, source_mac: bytes) -> bytes:
    """The packet in an Ethernet frame to all stations, as captures of ITS-G5 hold it."""
    return _BROADCAST + source_mac + struct.pack(">H", ETHERTYPE) + packet
