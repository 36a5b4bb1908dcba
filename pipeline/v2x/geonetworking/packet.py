"""Single-hop broadcast packets of GeoNetworking, secured or not (ETSI EN 302 636-4-1 v1.4.1, 9.6 to 9.8.4).

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

VERSION = 1
NEXT_COMMON, NEXT_SECURED = 1, 2
"""What follows the basic header."""
NEXT_BTP_B = 2
SINGLE_HOP_BROADCAST = 0x50
MOBILE = 0x80
LIFETIME_1_S = 0x05
"""Multiplier 1, base 1 s."""
MAX_PACKET_BYTES = 1500

_BASIC = struct.Struct(">BBBB")
_COMMON = struct.Struct(">BBBBHBB")
_BROADCAST = b"\xff" * 6


class PacketError(AdvpipeError):
    """The bytes are not a GeoNetworking packet that advpipe reads."""


class BasicPacket(NamedTuple):
    """A packet after its basic header. content: from the common header on, or a security envelope."""

    is_secured: bool
    content: bytes


class BroadcastPacket(NamedTuple):
    """The content of a single-hop broadcast. btp: the BTP-B header and what follows it."""

    sender: LongPositionVector
    btp: bytes


def broadcast_content(
    sender: LongPositionVector, btp: bytes, traffic_class: int = CAM.traffic_class
) -> bytes:
    """The common header, the extended header of a single-hop broadcast, and a BTP-B packet.

    traffic_class: of the type of message.

    The media-dependent data (channel load and power, for multi-hop congestion control) are 0.
    """
    common = _COMMON.pack(NEXT_BTP_B << 4, SINGLE_HOP_BROADCAST, traffic_class, MOBILE, len(btp), 1, 0)
    return common + sender.encode() + bytes(MEDIA_BYTES) + btp


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
    """Split the content of a single-hop broadcast with BTP-B. Raises PacketError for any other."""
    if len(content) < SHB_BYTES:
        raise PacketError(f"{len(content)} bytes are too few for a single-hop broadcast of {SHB_BYTES}")
    following, header_type, _, _, payload_bytes, _, _ = _COMMON.unpack_from(content)
    if header_type != SINGLE_HOP_BROADCAST or following >> 4 != NEXT_BTP_B:
        raise PacketError(
            f"header type 0x{header_type:02x} with next header {following >> 4} is no single-hop broadcast "
            "of BTP-B"
        )
    btp = content[SHB_BYTES:]
    if len(btp) != payload_bytes:
        raise PacketError(f"{len(btp)} bytes follow the headers, which announce {payload_bytes}")
    vector = content[COMMON_BYTES : COMMON_BYTES + VECTOR_BYTES]
    return BroadcastPacket(LongPositionVector.decode(vector), bytes(btp))


def ethernet_frame(packet: bytes, source_mac: bytes) -> bytes:
    """The packet in an Ethernet frame to all stations, as captures of ITS-G5 hold it."""
    return _BROADCAST + source_mac + struct.pack(">H", ETHERTYPE) + packet
