"""GeoNetworking packets: tshark reads them, and ours come back as they were."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from advpipe.pipeline.v2x.codec.btp import btp_packet, cam_payload
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.facilities.cam import cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.geonetworking.packet import (
    PacketError,
    broadcast_content,
    ethernet_frame,
    geonetworking_packet,
    parse_broadcast,
    parse_packet,
)
from advpipe.pipeline.v2x.geonetworking.position_vector import LongPositionVector, position_vector

NOW_NS = 1_767_268_800_250_000_000
MAC = bytes.fromhex("02a1b2c3d4e5")
FIELDS = {
    "eth.src": "02:a1:b2:c3:d4:e5",
    "geonw.bh.version": "1",
    "geonw.bh.nh": "1",
    "geonw.bh.rhl": "1",
    "geonw.bh.lt.mult": "1",
    "geonw.bh.lt.base": "1",
    "geonw.ch.nh": "2",
    "geonw.ch.htype": "0x50",
    "geonw.ch.tc.id": "2",
    "geonw.src_pos.lat": "480000001",
    "geonw.src_pos.long": "-110000000",
    "geonw.src_pos.pai": "1",
    "geonw.src_pos.speed": "1389",
    "geonw.src_pos.hdg": "900",
    "geonw.src_pos.tst": str(timestamp_its_ms(NOW_NS) % 2**32),
    "btpb.dstport": "2001",
    "its.stationID": "7",
    "_ws.malformed": "",
}


@pytest.fixture
def packet(car: Callable[..., StationState]) -> bytes:
    state = car(
        time_ns=NOW_NS, latitude_deg=48.0000001, longitude_deg=-11.0, heading_rad=math.pi / 2, speed_mps=13.89
    )
    cam = cam_of_state(state)
    vector = position_vector(cam, MAC, NOW_NS + 30_000_000)
    return geonetworking_packet(broadcast_content(vector, btp_packet(encode_cam(cam))))


def capture(path: Path, frames: Sequence[bytes]) -> None:
    """A pcap file of Ethernet frames."""
    records = [struct.pack("<IIII", 0, 0, len(frame), len(frame)) + frame for frame in frames]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + b"".join(records))


@pytest.mark.oracle
def test_tshark_reads_the_packet(packet: bytes, tmp_path: Path) -> None:
    if (program := shutil.which("tshark")) is None:
        pytest.skip("tshark is not installed")
    capture(tmp_path / "one.pcap", [ethernet_frame(packet, MAC)])
    command = [program, "-n", "-r", str(tmp_path / "one.pcap"), "-T", "fields"]
    for field in FIELDS:
        command += ["-e", field]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert dict(zip(FIELDS, output.removesuffix("\n").split("\t"), strict=True)) == FIELDS


def test_a_packet_is_read_back(packet: bytes) -> None:
    basic = parse_packet(packet)
    sender, btp, *_ = parse_broadcast(basic.content)
    assert not basic.is_secured
    assert (sender.mac, sender.station_type, sender.speed_cmps, sender.is_accurate) == (MAC, 5, 1389, True)
    assert packet.endswith(cam_payload(btp))
    assert len(packet) - len(cam_payload(btp)) == 44  # with LLC and MAC (38 bytes) v2x.radio.overhead_bytes


def test_a_vector_is_read_back_also_backwards_and_in_the_south() -> None:
    vector = LongPositionVector(15, MAC, 2**32 - 1, -(10**8), -(18 * 10**8), True, -250, 3599)
    assert LongPositionVector.decode(vector.encode()) == vector


def test_a_message_that_is_no_cam_has_no_position() -> None:
    vector = position_vector(None, MAC, NOW_NS)
    assert (vector.latitude, vector.is_accurate) == (0, False)
    assert vector.time_ms == timestamp_its_ms(NOW_NS) % 2**32


@pytest.mark.parametrize("change", [lambda d: d[:3], lambda d: b"\x01" + d[1:], lambda d: b"\x13" + d[1:]])
def test_other_packets_are_refused(packet: bytes, change: Callable[[bytes], bytes]) -> None:
    with pytest.raises(PacketError):
        parse_packet(change(packet))


@pytest.mark.parametrize(
    "change",
    [lambda d: d[:20], lambda d: d[:-1], lambda d: b"\x10" + d[1:], lambda d: d[:1] + b"\x41" + d[2:]],
)
def test_other_contents_are_refused(packet: bytes, change: Callable[[bytes], bytes]) -> None:
    with pytest.raises(PacketError):
        parse_broadcast(change(parse_packet(packet).content))
