"""The types of etsi_its_cpm_ts_msgs, and CPMs serialised as them."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import pytest

from advpipe.pipeline.messages.cam_cdr import message_cdr
from advpipe.pipeline.messages.cam_types import asn1_types, full_name
from advpipe.pipeline.messages.types import message_class, type_hash, typestore
from advpipe.pipeline.v2x.codec.cpm_codec import CONTAINERS, OBJECTS, SENSORS, CpmError
from advpipe.pipeline.v2x.message_type import CPM
from tests.pipeline.v2x.codec.test_cpm_codec import message

HASHES = json.loads(Path(__file__).with_name("cpm_type_hashes.json").read_text())
"""RIHS01 hashes of the types that the ROS 2 package etsi_its_cpm_ts_msgs defines."""


@pytest.mark.oracle
def test_cpm_definitions_equal_the_upstream_ones() -> None:
    assert len(HASHES) == 120
    assert {full_name(name, CPM.ros_package) for name in asn1_types(CPM.ros_package)} == HASHES.keys()
    for name, digest in HASHES.items():
        assert type_hash(name) == f"RIHS01_{digest}", name


def test_a_serialised_cpm_is_read_by_rosbags() -> None:
    rng = Random(1)
    assert message_class(CPM.ros_name)
    for _ in range(20):
        tree = message(rng, (SENSORS, OBJECTS))
        read = typestore().deserialize_cdr(message_cdr(CPM, tree), CPM.ros_name)
        assert read.header.station_id.value == tree["header"]["stationId"]
        sensors, objects = read.payload.cpm_containers.value.array
        assert sensors.container_id.value == SENSORS
        assert objects.container_data_sensor_information_container.array == []
        listed = tree["payload"]["cpmContainers"][1]["containerData"]["perceivedObjects"]
        found = objects.container_data_perceived_object_container.perceived_objects.array
        assert [one.position.x_coordinate.value.value for one in found] == [
            one["position"]["xCoordinate"]["value"] for one in listed
        ]
        assert [one.object_id_is_present for one in found] == ["objectId" in one for one in listed]


def test_a_container_of_a_later_release_is_refused() -> None:
    tree = message(Random(2), tuple(CONTAINERS))
    tree["payload"]["cpmContainers"].append({"containerId": 9, "containerData": b""})
    with pytest.raises(CpmError, match="cannot hold a value of this CPM: 9"):
        message_cdr(CPM, tree)
