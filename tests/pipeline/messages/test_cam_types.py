from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from advpipe.pipeline.messages.cam_types import cam_types, full_name
from advpipe.pipeline.messages.types import message_class, schema_text, type_hash

HASHES = json.loads(Path(__file__).with_name("cam_type_hashes.json").read_text())
"""RIHS01 hashes of the types that the ROS 2 packages etsi_its_cam_msgs and udp_msgs define."""


@pytest.mark.oracle
def test_definitions_equal_the_upstream_ones() -> None:
    assert len(HASHES) == 95
    assert {full_name(name) for name in cam_types()} == HASHES.keys() - {"udp_msgs/msg/UdpPacket"}
    for name, digest in HASHES.items():
        assert type_hash(name) == f"RIHS01_{digest}", name


def test_schema_holds_the_nested_types() -> None:
    text = schema_text(full_name("CAM"))
    assert text.startswith("etsi_its_cam_msgs/ItsPduHeader header\netsi_its_cam_msgs/CoopAwareness cam\n")
    assert text.count("MSG: etsi_its_cam_msgs/") == 93


def test_fields_follow_from_each_asn1_type() -> None:
    def fields(name: str) -> list[str]:
        return list(message_class(full_name(name)).__dataclass_fields__)[:4]

    assert fields("HighFrequencyContainer")[:2] == ["choice", "basic_vehicle_container_high_frequency"]
    assert fields("PathPoint")[:3] == ["path_position", "path_delta_time", "path_delta_time_is_present"]
    assert fields("AccelerationControl")[:2] == ["value", "bits_unused"]
    assert fields("PathHistory")[0] == "array"


def test_the_cam_types_are_loaded_on_demand() -> None:
    code = (
        "import sys; from advpipe.pipeline.bag import reader, writer;"
        "from advpipe.pipeline.messages import build, types; types.typestore();"
        "types.schema_text('std_msgs/msg/Header'); assert not any('pycrate' in name for name in sys.modules);"
        "types.message_class('etsi_its_cam_msgs/msg/CAM'); assert 'pycrate_asn1dir' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
