"""Envelopes: pycrate and tshark read them, and any change of a signed byte shows."""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.geonetworking.packet import ethernet_frame
from advpipe.pipeline.v2x.security.coer import EnvelopeError
from advpipe.pipeline.v2x.security.envelope import Envelope, sign_envelope
from advpipe.pipeline.v2x.security.pki import Pki
from advpipe.pipeline.v2x.stack import PacketBuilder, mac_address

NOW_NS = 1_767_268_800_000_000_000 + 250_123_456


def asn1_data() -> Any:
    from pycrate_asn1dir import ITS_IEEE1609_2

    return ITS_IEEE1609_2.Ieee1609Dot2.Ieee1609Dot2Data


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("content", "with_certificate"), [(b"", True), (bytes(127), False), (bytes(300), True)]
)
def test_pycrate_encodes_the_same_bytes(pki: Pki, content: bytes, with_certificate: bool) -> None:
    envelope = sign_envelope(content, NOW_NS, *pki.ticket("car"), with_certificate)
    encoded, asn1 = envelope.encode(), asn1_data()
    asn1.from_coer(encoded)
    values = asn1.get_val()
    asn1.set_val(values)
    assert asn1.to_coer() == encoded
    kind, signed = values["content"]
    assert kind == "signedData"
    assert signed["tbsData"]["payload"]["data"]["content"] == ("unsecuredData", content)
    time_us = timestamp_its_ms(NOW_NS) * 1000 + 123
    assert signed["tbsData"]["headerInfo"] == {"psid": 36, "generationTime": time_us}
    assert signed["signer"][0] == ("certificate" if with_certificate else "digest")
    r_sig, s_sig = signed["signature"][1]["rSig"], signed["signature"][1]["sSig"]
    assert r_sig[0] == "x-only"
    assert r_sig[1] + s_sig == envelope.signature


@pytest.mark.oracle
def test_pycrate_reads_the_place_where_a_denm_was_signed(pki: Pki) -> None:
    location = struct.pack(">iiH", 481_000_000, -115_000_000, 4095)
    envelope = sign_envelope(b"denm", NOW_NS, *pki.ticket("car"), True, 37, location)
    encoded, asn1 = envelope.encode(), asn1_data()
    asn1.from_coer(encoded)
    values = asn1.get_val()
    asn1.set_val(values)
    assert asn1.to_coer() == encoded
    header = values["content"][1]["tbsData"]["headerInfo"]
    assert header["generationLocation"] == {
        "latitude": 481_000_000,
        "longitude": -115_000_000,
        "elevation": 4095,
    }
    assert Envelope.decode(encoded) == envelope
    assert Envelope.decode(encoded).is_signed_by(pki.ticket("car")[0])


@pytest.mark.oracle
def test_tshark_reads_signed_packets(builder: PacketBuilder, payload: bytes, tmp_path: Path) -> None:
    if (program := shutil.which("tshark")) is None:
        pytest.skip("tshark is not installed")
    mac = mac_address(1, 7)
    packets = [builder.packet(7, NOW_NS + late_ns, payload) for late_ns in (0, 300_000_000)]
    frames = [ethernet_frame(packet, mac) for packet in packets]
    records = [struct.pack("<IIII", 0, 0, len(frame), len(frame)) + frame for frame in frames]
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    (tmp_path / "signed.pcap").write_bytes(header + b"".join(records))
    fields = (
        "geonw.bh.nh",
        "ieee1609dot2.protocolVersion",
        "ieee1609dot2.psid",
        "ieee1609dot2.generationTime",
        "ieee1609dot2.signer",
        "btpb.dstport",
        "its.stationID",
        "_ws.malformed",
    )
    command = [program, "-n", "-r", str(tmp_path / "signed.pcap"), "-T", "fields", "-E", "occurrence=f"]
    for field in fields:
        command += ["-e", field]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    lines = [line.split("\t") for line in output.splitlines()]
    times_us = [str(timestamp_its_ms(NOW_NS + late) * 1000 + 123) for late in (0, 300_000_000)]
    assert lines == [
        ["2", "3", "36", times_us[0], "1", "2001", "7", ""],
        ["2", "3", "36", times_us[1], "0", "2001", "7", ""],
    ]


def test_an_envelope_is_read_back(pki: Pki) -> None:
    ticket, key = pki.ticket("car")
    for with_certificate in (True, False):
        envelope = sign_envelope(b"content", NOW_NS, ticket, key, with_certificate)
        assert Envelope.decode(envelope.encode()) == envelope
        assert envelope.is_signed_by(ticket)
        assert envelope.digest == ticket.digest
        assert envelope.generation_ns == NOW_NS - NOW_NS % 1000
    assert len(envelope.encode()) == len(b"content") + 93


def test_signatures_are_deterministic(pki: Pki) -> None:
    once, again = (sign_envelope(b"x", NOW_NS, *pki.ticket("car"), True).encode() for _ in range(2))
    assert once == again


def test_a_change_of_any_byte_shows(pki: Pki) -> None:
    ticket, key = pki.ticket("car")
    encoded = sign_envelope(b"content", NOW_NS, ticket, key, False).encode()
    for index in range(len(encoded)):
        changed = bytearray(encoded)
        changed[index] ^= 1
        try:
            envelope = Envelope.decode(bytes(changed))
        except EnvelopeError:
            continue
        assert not envelope.is_signed_by(ticket) or envelope.digest != ticket.digest


def test_a_cut_envelope_is_refused(pki: Pki) -> None:
    encoded = sign_envelope(b"content", NOW_NS, *pki.ticket("car"), True).encode()
    for size in range(len(encoded)):
        with pytest.raises(EnvelopeError):
            Envelope.decode(encoded[:size])
    with pytest.raises(EnvelopeError, match="1 bytes follow"):
        Envelope.decode(encoded + b"\0")
