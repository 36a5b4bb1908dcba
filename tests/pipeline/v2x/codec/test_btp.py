import pytest

from advpipe.pipeline.v2x.codec.btp import BtpPacket, btp_packet, cam_payload, parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError


def test_a_cam_has_its_btp_header() -> None:
    assert btp_packet(b"\x02\x02") == bytes.fromhex("07d10000 0202")
    assert cam_payload(bytes.fromhex("07d10000 0202")) == b"\x02\x02"


def test_any_port_round_trips() -> None:
    assert parse_btp_packet(btp_packet(b"x", 2002, 5)) == BtpPacket(2002, 5, b"x")


def test_other_packets_are_refused() -> None:
    with pytest.raises(CamError, match="3 bytes are too few for a BTP-B packet"):
        cam_payload(b"\x07\xd1\x00")
    with pytest.raises(CamError, match="BTP-B port 2002 is not the CAM port"):
        cam_payload(btp_packet(b"", 2002))
