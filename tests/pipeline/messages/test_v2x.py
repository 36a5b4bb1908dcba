"""Messages of V2X: the very bytes that rosbags makes of them, and back."""

from __future__ import annotations

import numpy as np
import pytest
from cam_as_message import cam_of_message, udp_packet

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.mcap.channel import StampedCdr
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import message_class, serialise, typestore
from advpipe.pipeline.messages.v2x import (
    RadioPlace,
    own_messages,
    received_messages,
    sent_message,
    sent_of_message,
    stations_message,
    stations_of,
    stations_of_message,
    udp_packet_cdr,
)
from advpipe.pipeline.v2x.channel import Received, Sent
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.ldm import Verdict
from advpipe.pipeline.v2x.section import V2x

STAMP_NS = 1_767_268_800_250_000_001
PLACES = tuple(
    RadioPlace(
        station_id,
        name,
        se3_from_yaw([1.1 * station_id, -2.2, 0.3], 0.1 * len(name), 0.05),
        (4.5, 1.8, 1.5),
        np.array([13.9, 0.1, -0.2]),
    )
    for station_id, name in ((7, "ego"), (2**31 - 1, "a"), (8, "flow.17"), (9, "ß"), (10, ""))
)


def again(stamped: StampedCdr) -> object:
    topic, cdr, _ = stamped
    message_class(topic.type)  # adds the types of CAMs to the store
    message = typestore().deserialize_cdr(cdr, topic.type)
    assert serialise(message, topic.type) == cdr
    return message


@pytest.mark.parametrize("count", range(len(PLACES) + 1))
def test_stations_round_trip(count: int) -> None:
    stamped = stations_message(STAMP_NS, PLACES[:count])
    found = stations_of_message(again(stamped))
    assert stamped[2] == STAMP_NS
    assert [one[:2] for one in found] == [one[:2] for one in PLACES[:count]]
    one_by_one, at_once = stations_of(V2x(), tuple(found)), stations_of(V2x(), found)
    assert (one_by_one.ids == at_once.ids).all()
    assert (one_by_one.antenna_m == at_once.antenna_m).all()
    for one, expected in zip(found, PLACES, strict=False):
        assert one.size_m == expected.size_m
        assert (one.map_SE3_base[:3, 3] == expected.map_SE3_base[:3, 3]).all()  # the radio: to the bit
        assert one.map_SE3_base == pytest.approx(expected.map_SE3_base)
        assert (one.velocity_mps == expected.velocity_mps).all()


@pytest.mark.parametrize("length", range(10))
def test_transmissions_round_trip(length: int) -> None:
    sent = Sent(2**63 + 5, 2**64 - 1, 2**32 - 1, STAMP_NS, bytes(range(length)), 23.5)
    stamped = sent_message(sent)
    assert sent_of_message(again(stamped)) == sent
    assert stamped[2] == STAMP_NS


@pytest.mark.parametrize("length", range(9))
def test_a_udp_packet_holds_btp_and_cam(length: int) -> None:
    payload = bytes(range(length))
    packet = udp_packet(STAMP_NS, payload)
    assert udp_packet_cdr(STAMP_NS, payload) == serialise(packet, VehicleTopics().sent_raw.type)


def test_sent_and_received_messages_hold_bytes_and_values(cam_vector: bytes) -> None:
    sent = Sent(0, 1, 7, STAMP_NS, cam_vector, 23.0)
    tree = decode_cam_tree(cam_vector)
    topics = VehicleTopics("ego")
    received = Received("ego", sent, tree, STAMP_NS + 500, -70.0, 20.0, Verdict.ACCEPTED)
    for found, names, stamp_ns in (
        (own_messages(topics, sent), (topics.sent_raw, topics.sent_cam), STAMP_NS),
        (received_messages(received), (topics.received_raw, topics.received_cam), STAMP_NS + 500),
    ):
        raw, cam, *_ = found
        assert (raw[0], cam[0]) == names
        assert (raw[2], cam[2]) == (stamp_ns, stamp_ns)
        assert bytes(again(raw).data[4:]) == cam_vector  # type: ignore[attr-defined]
        assert cam_of_message(again(cam)) == tree


@pytest.mark.parametrize("is_cam", [True, False])
def test_receptions_hold_power_sinr_and_the_true_transmission(cam_vector: bytes, is_cam: bool) -> None:
    """Of whatever is received, with the stamp of its packet; to the bit."""
    sent = Sent(2**63 - 1, 1, 2**32 - 1, STAMP_NS, cam_vector if is_cam else b"rubbish", 23.0)
    tree = decode_cam_tree(cam_vector) if is_cam else None
    received = Received("bus", sent, tree, STAMP_NS + 500, -70.1, 20.3, Verdict.ACCEPTED)
    *packet, info, truth = received_messages(received)
    assert len(packet) == (2 if is_cam else 1)
    assert [one[0].name for one in (info, truth)] == ["/bus/v2x/rx/info", "/bus/ground_truth/receptions"]
    how, what = again(info), again(truth)
    assert (how.power_dbm, how.sinr_db) == (-70.1, 20.3)  # type: ignore[attr-defined]
    assert (what.number, what.station_id) == (2**63 - 1, 2**32 - 1)  # type: ignore[attr-defined]
    assert all(stamped[2] == STAMP_NS + 500 for stamped in packet)
    for stamped in (packet[0], info, truth):
        assert stamped[2] == build.stamp_ns(again(stamped)) == STAMP_NS + 500


def test_bytes_that_are_no_cam_give_no_values() -> None:
    sent = Sent(0, 1, 7, STAMP_NS, b"\x02\x02rubbish", 23.0)
    (own,) = own_messages(VehicleTopics("ego"), sent)
    (heard, *_) = received_messages(Received("ego", sent, None, STAMP_NS, -70.0, 20.0, Verdict.CORRUPT))
    assert (own[0].name, heard[0].name) == ("/ego/v2x/tx/raw", "/ego/v2x/rx/raw")
    assert bytes(again(heard).data) == bytes.fromhex("07d10000") + b"\x02\x02rubbish"  # type: ignore[attr-defined]
