"""DDS types from a bag's definitions: Cyclone reads and writes the bag's bytes with them."""

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.types import type_hash
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

pytest.importorskip("cyclonedds")

from advpipe.pipeline.live.dds_types import DdsType, dds_type_name


def published(definition: str, name: str = "our_msgs/msg/Thing") -> PublishedTopic:
    return PublishedTopic(Topic("/things", name), definition)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive in which everybody sends CAMs, with hardly any points."""
    coarse = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")
    settings = (*coarse, "simulation.duration_s=1", "v2x.penetration=1")
    return simulate(load_scenario("smoke", settings), tmp_path_factory.mktemp("types") / "drive").bag


@pytest.mark.oracle
def test_cyclone_reads_every_type_of_a_bag_and_writes_the_same_bytes(drive: Path) -> None:
    seen = set()
    for raw in BagReader(drive).raw_messages():
        if raw.topic.type in seen or raw.topic.type == "sensor_msgs/msg/PointCloud2":  # slow in Python
            continue
        kind = DdsType(PublishedTopic(raw.topic, raw.schema))
        for struct in kind._built.values():
            struct.__init__ = lambda self, **fields: vars(self).update(fields)  # type: ignore[misc]
        message = kind.struct.deserialize(raw.cdr)
        written = message.serialize(use_version_2=False)
        assert written.ljust(len(raw.cdr), b"\0") == raw.cdr
        assert kind.hash == type_hash(raw.topic.type)
        seen.add(raw.topic.type)
    assert len(seen) == 17
    assert "etsi_its_cam_msgs/msg/CAM" in seen


@pytest.mark.oracle
def test_every_kind_of_field() -> None:
    definition = """
bool a
byte b
char c
int8[3] d
uint64[] e
float32[<=4] f
string g
string<=5 h
string<=4[<=2] i
our_msgs/Part j
our_msgs/Part[2] k
float64[<=70000] l
================================================================================
MSG: our_msgs/Part
uint16 number
"""
    struct = DdsType(published(definition)).struct
    assert struct.__idl_typename__ == "our_msgs::msg::dds_::Thing_"
    part = struct.__annotations__["j"]
    assert part.__idl_typename__ == "our_msgs::msg::dds_::Part_"
    struct.__idl__.populate()
    assert list(struct.__annotations__) == list("abcdefghijkl")


def test_names() -> None:
    assert dds_type_name("etsi_its_cam_msgs/msg/CAM") == "etsi_its_cam_msgs::msg::dds_::CAM_"


@pytest.mark.parametrize(
    ("definition", "reason"),
    [
        ("wstring text", "its field text is a wstring"),
        ("float128 x", "float128"),
        ("what is this", "its definition cannot be used"),
        ("other_msgs/Missing x", "its definition cannot be used"),
    ],
)
def test_types_that_cannot_be_published(definition: str, reason: str) -> None:
    with pytest.raises(UnpublishableTypeError, match=reason) as found:
        DdsType(published(definition))
    assert str(found.value).startswith("/things cannot be published to ROS 2: our_msgs/msg/Thing: ")
    assert "\n" not in str(found.value)
