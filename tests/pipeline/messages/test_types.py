import pytest

from advpipe.pipeline.messages.types import schema_text, type_hash, typestore

UPSTREAM_HASHES = {
    "vision_msgs/msg/BoundingBox3D": "bbb73a65c163d7f9bb29009c7bde9f7faa576bd2d23299c4511d19230dab4698",
    "vision_msgs/msg/Detection3D": "ddd703be132ab0b69d33121f1bb034132bfbb3b0ac5f9fb1516005ba1c8a265b",
    "vision_msgs/msg/Detection3DArray": "793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018",
    "vision_msgs/msg/ObjectHypothesis": "51da43cec11c01957a64d1e05a24acd18aae7745ec30b74348ad5f6d634f7f90",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "41c12344c0396c48b81df12467c192d99b2a0eb1463c5c37194e4223251c80bc"
    ),
}
"""RIHS01 hashes of vision_msgs 4.1.1 as ROS 2 Humble and Jazzy ship it."""


@pytest.mark.oracle
@pytest.mark.parametrize("name", UPSTREAM_HASHES)
def test_definitions_equal_the_installed_ones(name: str) -> None:
    assert type_hash(name) == f"RIHS01_{UPSTREAM_HASHES[name]}"


def test_advpipes_messages_have_the_agreed_fields() -> None:
    assert [name for name, _ in typestore().fielddefs["advpipe_msgs/msg/RoadUser"][1]] == [
        "id",
        "class_id",
        "pose",
        "size",
        "velocity",
        "lidar_points",
        "occlusion",
    ]


def test_schema_holds_the_nested_types() -> None:
    text = schema_text("advpipe_msgs/msg/RoadUserArray")
    assert text.startswith("std_msgs/Header header\nadvpipe_msgs/RoadUser[] road_users\n")
    assert "MSG: geometry_msgs/Vector3\n" in text
