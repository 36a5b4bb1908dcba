"""Received messages read back: three topics that belong together by their stamps, two of them optional."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cam_as_message import UDP_TYPE, udp_packet

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import RecordedReception, receiving_vehicles, recorded_receptions
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.messages.v2x import StampedCdr, received_messages
from advpipe.pipeline.v2x.channel import Received, Sent
from advpipe.pipeline.v2x.facilities.ldm import Verdict
from advpipe.pipeline.v2x.message_type import CAM, DENM

EGO = VehicleTopics("ego")


def received(number: int, arrival_ns: int, listener: str = "ego") -> list[StampedCdr]:
    sent = Sent(number, 1, 70 + number, arrival_ns - 5, b"cam %d" % number, 23.0)
    one = Received(listener, sent, None, arrival_ns, -60.0 - number, 20.5 + number, Verdict.CORRUPT)
    return list(received_messages(one))


def bag_of(path: Path, messages: Iterable[StampedCdr]) -> BagReader:
    with BagWriter(path, provenance={}) as bag:
        for message in messages:
            bag.write_cdr(*message)
    return BagReader(path)


def test_of_two_at_once_the_first_belongs_to_the_first(tmp_path: Path) -> None:
    """Also where each topic's messages lie together, as another recorder may write them."""
    at_once = [received(1, 100), received(2, 100), received(3, 250)]
    by_topic = [message for same in zip(*at_once, strict=True) for message in same]
    expected = [
        RecordedReception(100, b"cam 1", -61.0, 21.5, 1, 71),
        RecordedReception(100, b"cam 2", -62.0, 22.5, 2, 72),
        RecordedReception(250, b"cam 3", -63.0, 23.5, 3, 73),
    ]
    for name, messages in (("step", [m for one in at_once for m in one]), ("topic", by_topic)):
        reader = bag_of(tmp_path / name, messages)
        assert recorded_receptions(reader, "ego") == expected
        assert recorded_receptions(reader, "ego", last_ns=249) == expected[:2]
        assert recorded_receptions(reader, "bus") == []


def test_what_a_bag_does_not_state_is_not_known(tmp_path: Path) -> None:
    """As of a real vehicle, whose driver writes the packets alone, by its own clock."""
    packet = serialise(udp_packet(100, b"cam"), UDP_TYPE)
    reader = bag_of(tmp_path / "bag", [(EGO.received_raw, packet, 100 + 30_000)])
    (one,) = recorded_receptions(reader, "ego")
    assert (one.arrival_ns, one.payload, one.number, one.station_id) == (100, b"cam", None, None)
    assert math.isnan(one.power_dbm)
    assert math.isnan(one.sinr_db)


@pytest.mark.parametrize("data", [b"", b"\x07", b"\x07\xd3\x00\x00for MAPEMs"])
def test_packets_that_are_for_nobody(tmp_path: Path, data: bytes) -> None:
    message = udp_packet(100, b"")
    message.data = np.frombuffer(data, np.uint8)
    reader = bag_of(tmp_path / "bag", [(EGO.received_raw, serialise(message, UDP_TYPE), 100)])
    assert [one.payload for one in recorded_receptions(reader, "ego")] == [None]


def test_each_type_of_message_is_read_by_itself(tmp_path: Path) -> None:
    messages = []
    for stamp_ns, data in ((100, b"\x07\xd1\x00\x00cam"), (200, b"\x07\xd2\x00\x00denm")):
        message = udp_packet(stamp_ns, b"")
        message.data = np.frombuffer(data, np.uint8)
        messages.append((EGO.received_raw, serialise(message, UDP_TYPE), stamp_ns))
    reader = bag_of(tmp_path / "bag", messages)
    assert [one.payload for one in recorded_receptions(reader, "ego")] == [b"cam"]
    assert [one.payload for one in recorded_receptions(reader, "ego", kind=DENM)] == [b"denm"]


@pytest.mark.parametrize("place", [1, 2])
def test_a_message_beside_that_belongs_to_none(tmp_path: Path, place: int) -> None:
    messages = [*received(1, 100), received(2, 250)[place]]
    reader = bag_of(tmp_path / "bag", messages)
    with pytest.raises(AdvpipeError, match=r"at 250 ns matches no message of /ego/v2x/rx/raw"):
        recorded_receptions(reader, "ego")


@pytest.mark.parametrize("topic", [EGO.received_raw, EGO.reception_info, EGO.true_receptions])
def test_topics_of_another_type(tmp_path: Path, topic: object) -> None:
    messages = [message for message in received(1, 100) if message[0] != topic]
    text = serialise(build.string("x"), "std_msgs/msg/String")
    other = replace(topic, type="std_msgs/msg/String")  # type: ignore[type-var]
    reader = bag_of(tmp_path / "bag", [*messages, (other, text, 100)])
    for kind in (CAM, DENM):  # also where no packet is of the type
        with pytest.raises(AdvpipeError, match=r"holds std_msgs/msg/String, not \w+_msgs/msg/"):
            recorded_receptions(reader, "ego", kind=kind)


def test_who_receives(tmp_path: Path) -> None:
    other = replace(EGO.received_raw, name="/v2x/rx/raw")  # of no vehicle
    messages = [*received(1, 100, "bus_3"), *received(1, 100), (other, received(1, 100)[0][1], 100)]
    assert receiving_vehicles(bag_of(tmp_path / "bag", messages)) == ["bus_3", "ego"]
