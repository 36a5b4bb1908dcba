from __future__ import annotations

import json
from pathlib import Path

import pytest

from advpipe.pipeline.messages.cam_cdr import message_cdr
from advpipe.pipeline.messages.cam_types import asn1_types, full_name
from advpipe.pipeline.messages.types import type_hash, typestore
from advpipe.pipeline.v2x.facilities.denm import ActionId, Denm, EventKind, denm_tree
from advpipe.pipeline.v2x.message_type import DENM

HASHES = json.loads(Path(__file__).with_name("denm_type_hashes.json").read_text())
"""RIHS01 hashes of the types in the ROS 2 package etsi_its_denm_msgs that a DENM holds."""


@pytest.mark.oracle
def test_definitions_equal_the_upstream_ones() -> None:
    names = {full_name(name, DENM.ros_package) for name in asn1_types(DENM.ros_package)}
    assert names == HASHES.keys()
    assert len(names) == 81
    for name, digest in HASHES.items():
        assert type_hash(name) == f"RIHS01_{digest}", name


@pytest.mark.oracle
def test_rosbags_reads_the_serialised_message() -> None:
    denm = Denm(
        station_id=5,
        action=ActionId(6, 7),
        detection_ns=1_767_268_800_000_000_000,
        reference_ns=1_767_268_800_100_000_000,
        station_type=5,
        latitude_deg=48.0,
        longitude_deg=11.0,
        kind=EventKind.BRAKING,
        speed_mps=3.0,
    )
    assert type_hash(DENM.ros_name)  # registers the types
    message = typestore().deserialize_cdr(message_cdr(DENM, denm_tree(denm)), DENM.ros_name)
    body = message.denm  # type: ignore[attr-defined]
    assert message.header.station_id.value == 5  # type: ignore[attr-defined]
    assert body.management.action_id.originating_station_id.value == 6
    assert body.management.event_position.latitude.value == 480_000_000
    assert body.management.validity_duration.value == 600
    assert not body.management.termination_is_present
    assert body.situation_is_present
    assert body.situation.event_type.cause_code.value == 99
    assert body.location.event_speed.speed_value.value == 300
    assert not body.alacarte_is_present
