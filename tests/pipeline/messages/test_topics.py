import pytest
import yaml

from advpipe.pipeline.mcap.qos import qos_from_yaml, qos_to_yaml
from advpipe.pipeline.messages import topics
from advpipe.pipeline.messages.topics import VehicleTopics


def test_qos_round_trips() -> None:
    for topic in (topics.CLOCK, topics.TF, topics.TF_STATIC, VehicleTopics().lidar_points):
        text = qos_to_yaml(topic.qos)
        assert qos_from_yaml(text) == topic.qos
        assert "\n" not in text


def test_numbers_equal_those_of_rmw() -> None:
    (latched,) = yaml.safe_load(qos_to_yaml(topics.TF_STATIC.qos))
    assert (latched["history"], latched["depth"]) == (1, 1)
    assert (latched["reliability"], latched["durability"]) == (1, 1)
    (clock,) = yaml.safe_load(qos_to_yaml(topics.CLOCK.qos))
    assert (clock["reliability"], clock["durability"]) == (2, 2)


@pytest.mark.oracle
def test_names_written_by_jazzy_are_read() -> None:
    from rosbags.rosbag2.metadata import dump_qos_v9

    text = yaml.safe_dump(dump_qos_v9(list(topics.TF_STATIC.qos)))
    assert "transient_local" in text
    assert qos_from_yaml(text) == topics.TF_STATIC.qos


def test_a_vehicles_topics_have_its_namespace() -> None:
    bus = VehicleTopics("bus_3")
    assert bus.lidar_points.name == "/bus_3/lidar/points"
    assert bus.objects.name == "/bus_3/ground_truth/objects"
    assert (bus.base_frame, bus.lidar_frame) == ("bus_3/base_link", "bus_3/lidar")
