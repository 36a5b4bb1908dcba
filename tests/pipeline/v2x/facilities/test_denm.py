"""DENMs: ours come back, pycrate encodes the same bits, tshark reads the same values."""

from __future__ import annotations

import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from advpipe.pipeline.v2x.codec.denm_codec import DENM_CODEC, DenmError
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.facilities.cam import PathPoint
from advpipe.pipeline.v2x.facilities.denm import (
    ActionId,
    Denm,
    EventKind,
    Termination,
    decode_denm,
    denm_tree,
    encode_denm,
)
from advpipe.pipeline.v2x.geonetworking.packet import ethernet_frame
from advpipe.pipeline.v2x.section import DenmRules, V2x
from advpipe.pipeline.v2x.stack import PacketBuilder, ReceiverStack, mac_address

NOW_NS = 1_767_268_800_250_000_000
BRAKING = Denm(
    station_id=7,
    action=ActionId(7, 513),
    detection_ns=NOW_NS - 250_000_000,
    reference_ns=NOW_NS,
    station_type=5,
    latitude_deg=48.1,
    longitude_deg=-11.5,
    altitude_m=500.0,
    validity_s=10,
    interval_s=0.5,
    kind=EventKind.BRAKING,
    speed_mps=12.5,
    heading_rad=1.0,
    traces=(PathPoint(1e-5, -2e-5, 0.0, 0.4),),
)
PARKED = replace(BRAKING, kind=EventKind.STOPPED, altitude_m=None, validity_s=600, traces=())
CANCELLED, NEGATED = BRAKING.terminated(7, NOW_NS + 10**9), BRAKING.terminated(9, NOW_NS + 10**9)


@pytest.mark.parametrize("denm", [BRAKING, PARKED, CANCELLED, NEGATED])
def test_a_denm_comes_back_and_pycrate_agrees(denm: Denm) -> None:
    tree = denm_tree(denm)
    payload = encode_denm(denm)
    assert DENM_CODEC.asn1.to_uper(denm_tree(denm)) == payload
    DENM_CODEC.asn1.from_uper(payload)
    assert DENM_CODEC.asn1.get_val() == DENM_CODEC.decode(payload) == tree
    heading_rad = None if denm.kind is None else pytest.approx(1.0, abs=1e-3)
    speed_mps = denm.speed_mps if denm.kind else None
    expected = replace(denm, traces=(), heading_rad=heading_rad, speed_mps=speed_mps)
    assert decode_denm(payload) == expected


def test_its_originator_cancels_an_event_and_others_negate_it() -> None:
    assert (CANCELLED.termination, CANCELLED.reference_ns) == (Termination.CANCELLATION, NOW_NS + 10**9)
    assert (NEGATED.termination, NEGATED.reference_ns) == (Termination.NEGATION, NOW_NS)
    assert (NEGATED.station_id, NEGATED.action) == (9, BRAKING.action)


def test_other_bytes_are_refused() -> None:
    payload = encode_denm(BRAKING)
    for size in range(len(payload)):
        with pytest.raises(DenmError, match=f"^{size} bytes are not a DENM"):
            decode_denm(payload[:size])
    with pytest.raises(DenmError, match="message 2 of protocol version 2 is not a DENM"):
        decode_denm(b"\x02\x02" + payload[2:])


def test_a_text_in_a_container_a_la_carte_goes_through_pycrate() -> None:
    tree = denm_tree(BRAKING)
    goods = {
        "dangerousGoodsType": "explosives1",
        "unNumber": 1,
        "elevatedTemperature": False,
        "tunnelsRestricted": True,
        "limitedQuantity": False,
        "companyName": "Ä",
    }
    tree["denm"]["alacarte"] = {"stationaryVehicle": {"carryingDangerousGoods": goods}}
    assert DENM_CODEC.decode(DENM_CODEC.encode(tree)) == tree


def packets(security: str) -> list[bytes]:
    section = V2x(geonetworking=True, security=security, denm=DenmRules())  # type: ignore[arg-type]
    builder = PacketBuilder(section, 1, NOW_NS)
    payloads = [encode_denm(denm) for denm in (BRAKING, CANCELLED)]
    found = [builder.packet(7, NOW_NS + at, payload) for at, payload in enumerate(payloads)]
    stack = ReceiverStack(section, 1, NOW_NS)
    delivered = [stack.deliver("ego", packet, NOW_NS + 10**6) for packet in found]
    assert [each.payload for each in delivered] == payloads
    return found


@pytest.mark.oracle
@pytest.mark.parametrize("security", ["none", "etsi"])
def test_tshark_reads_geographical_broadcasts_of_denms(security: str, tmp_path: Path) -> None:
    if (program := shutil.which("tshark")) is None:
        pytest.skip("tshark is not installed")
    if security == "etsi":
        pytest.importorskip("cryptography")
    mac = mac_address(1, 7)
    frames = [ethernet_frame(packet, mac) for packet in packets(security)]
    records = [struct.pack("<IIII", 0, 0, len(frame), len(frame)) + frame for frame in frames]
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    (tmp_path / "denms.pcap").write_bytes(header + b"".join(records))
    fields = {
        "geonw.ch.htype": ("0x40", "0x40"),
        "geonw.ch.tc.id": ("1", "1"),
        "geonw.seq_num": ("0x0000", "0x0001"),
        "geonw.gxc.latitude": ("481000000", "481000000"),
        "geonw.gxc.longitude": ("-115000000", "-115000000"),
        "geonw.gxc.radius": ("500", "500"),
        "btpb.dstport": ("2002", "2002"),
        "its.messageID": ("1", "1"),
        "its.stationID": ("7", "7"),
        "its.originatingStationID": ("7", "7"),
        "its.sequenceNumber": ("513", "513"),
        "denm.detectionTime": tuple(str(timestamp_its_ms(one.detection_ns)) for one in (BRAKING, CANCELLED)),
        "denm.referenceTime": tuple(str(timestamp_its_ms(one.reference_ns)) for one in (BRAKING, CANCELLED)),
        "denm.termination": ("", "0"),
        "denm.validityDuration": ("10", "10"),
        "denm.transmissionInterval": ("500", "500"),
        "its.causeCode": ("99", ""),
        "its.subCauseCode": ("1", ""),
        "its.speedValue": ("1250", ""),
        "its.headingValue": ("573", ""),
        "its.deltaLatitude": ("100", ""),
        "_ws.malformed": ("", ""),
    }
    command = [program, "-n", "-r", str(tmp_path / "denms.pcap"), "-T", "fields"]
    for field in fields:
        command += ["-e", field]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    for place, line in enumerate(lines):
        found = dict(zip(fields, line.split("\t"), strict=True))
        assert found == {field: values[place] for field, values in fields.items()}
    assert len(lines) == 2
