"""BTP-B, the transport header before a CAM (ETSI EN 302 636-5-1): destination port and port info."""

from __future__ import annotations

import struct
from typing import NamedTuple

from advpipe.pipeline.v2x.codec.cam_error import CamError

CAM_PORT = 2001
"""Well-known destination port of CAMs (ETSI TS 103 248)."""

HEADER_BYTES = 4


class BtpPacket(NamedTuple):
    """The parts of a BTP-B packet."""

    destination_port: int
    destination_port_info: int
    payload: bytes


def btp_packet(payload: bytes, destination_port: int = CAM_PORT, destination_port_info: int = 0) -> bytes:
    """A BTP-B packet: the header of four bytes, then the payload."""
    return struct.pack(">HH", destination_port, destination_port_info) + payload


def parse_btp_packet(data: bytes) -> BtpPacket:
    """Split a BTP-B packet. Raises CamError for fewer bytes than a header."""
    if len(data) < HEADER_BYTES:
        raise CamError(f"{len(data)} bytes are too few for a BTP-B packet, whose header has {HEADER_BYTES}")
    port, info = struct.unpack_from(">HH", data)
    return BtpPacket(port, info, bytes(data[HEADER_BYTES:]))


def cam_payload(data: bytes) -> bytes:
    """The CAM in a BTP-B packet. Raises CamError where the packet is for another port."""
    packet = parse_btp_packet(data)
    if packet.destination_port != CAM_PORT:
        raise CamError(f"BTP-B port {packet.destination_port} is not the CAM port, {CAM_PORT}")
    return packet.payload
