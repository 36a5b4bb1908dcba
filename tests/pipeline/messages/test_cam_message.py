from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cam_as_message as cam_message
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.cam_cdr import cam_cdr
from advpipe.pipeline.messages.cam_types import full_name
from advpipe.pipeline.messages.types import serialise, typestore
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree

CamTree = dict[str, Any]
CAM_TYPE = full_name("CAM")
STAMP_NS = 1_767_268_800_250_000_000


def through_cdr(tree: CamTree) -> Any:
    return typestore().deserialize_cdr(serialise(cam_message.cam_message(tree), CAM_TYPE), CAM_TYPE)


def test_the_test_vector_becomes_the_expected_message(cam_vector: bytes) -> None:
    message = through_cdr(decode_cam_tree(cam_vector))
    assert message.header.station_id.value == 0xCAFE01
    parameters = message.cam.cam_parameters
    position = parameters.basic_container.reference_position
    assert (position.latitude.value, position.altitude.altitude_confidence.value) == (487_654_321, 5)
    assert parameters.high_frequency_container.choice == 0
    high = parameters.high_frequency_container.basic_vehicle_container_high_frequency
    assert high.speed.speed_value.value == 1389
    assert high.acceleration_control_is_present
    assert not high.lane_position_is_present
    assert bytes(high.acceleration_control.value) == b"\x40"  # the gas pedal, of seven bits
    assert high.acceleration_control.bits_unused == 1
    assert parameters.low_frequency_container_is_present
    assert not parameters.special_vehicle_container_is_present
    low = parameters.low_frequency_container.basic_vehicle_container_low_frequency
    assert [point.path_delta_time.value for point in low.path_history.array] == [110, 220, 330, 440]
    assert encode_cam_tree(cam_message.cam_of_message(message)) == cam_vector


def test_sizes_equal_those_of_the_upstream_messages(cam_vector: bytes) -> None:
    """Measured with the upstream definitions: 209 bytes without path points, 577 with 23."""
    tree = decode_cam_tree(cam_vector)
    history = tree["cam"]["camParameters"]["lowFrequencyContainer"][1]["pathHistory"]
    for points, size in ((0, 209), (23, 577)):
        history[:] = [
            {"pathPosition": dict.fromkeys(("deltaLatitude", "deltaLongitude", "deltaAltitude"), 0)}
        ]
        history[:] *= points
        assert len(cam_cdr(tree)) == size


def test_every_value_round_trips(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        tree = random_cam_tree(rng)
        assert cam_message.cam_of_message(through_cdr(tree)) == tree


def test_messages_do_not_share_absent_parts(random_cam_tree: Callable[..., CamTree]) -> None:
    rng = np.random.default_rng(1)
    before = serialise(cam_message.cam_message(tree := random_cam_tree(rng)), CAM_TYPE)
    for _ in range(20):
        cam_message.cam_message(random_cam_tree(rng))
    assert serialise(cam_message.cam_message(tree), CAM_TYPE) == before


def test_a_message_with_an_unknown_choice_is_refused(cam_vector: bytes) -> None:
    message = through_cdr(decode_cam_tree(cam_vector))
    message.cam.cam_parameters.high_frequency_container.choice = 2
    with pytest.raises(CamError, match="HighFrequencyContainer has no alternative 2"):
        cam_message.cam_of_message(message)


def test_a_udp_packet_holds_the_cam(cam_vector: bytes) -> None:
    packet = cam_message.udp_packet(STAMP_NS, cam_vector, address="7")
    cdr = serialise(packet, cam_message.UDP_TYPE)
    again = typestore().deserialize_cdr(cdr, cam_message.UDP_TYPE)
    assert bytes(again.data) == bytes.fromhex("07d10000") + cam_vector
    assert (again.header.stamp.sec, again.header.stamp.nanosec) == (1_767_268_800, 250_000_000)
    assert again.address == "7"


def test_other_libraries_read_the_messages_from_a_bag(tmp_path: Path, cam_vector: bytes) -> None:
    raw, decoded = Topic("/ego/v2x/rx/raw", cam_message.UDP_TYPE), Topic("/ego/v2x/rx/cam", CAM_TYPE)
    with BagWriter(tmp_path / "bag", provenance={"kind": "clean"}) as bag:
        bag.write(raw, cam_message.udp_packet(STAMP_NS, cam_vector), STAMP_NS)
        bag.write_cdr(decoded, cam_cdr(decode_cam_tree(cam_vector)), STAMP_NS)
    with AnyReader([tmp_path / "bag"]) as reader:
        found = {
            connection.topic: reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
        }
    assert bytes(found["/ego/v2x/rx/raw"].data[4:]) == cam_vector
    assert encode_cam_tree(cam_message.cam_of_message(found["/ego/v2x/rx/cam"])) == cam_vector
    ((_, message),) = BagReader(tmp_path / "bag").messages("/ego/v2x/rx/cam")
    assert encode_cam_tree(cam_message.cam_of_message(message)) == cam_vector
