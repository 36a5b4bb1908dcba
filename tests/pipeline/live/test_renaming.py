"""Topics under the names of CARLA's ROS bridge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.published_names import published_names
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.renaming import RenamingPublisher
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.bridge_messages import bridge_message
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.images import jpeg_message
from advpipe.pipeline.messages.topic_names import published_name
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.messages.types import schema_text, serialise
from advpipe.pipeline.scenario import dump_scenario, load_scenario


class Collector:
    """A publisher that keeps what it gets."""

    def __init__(self) -> None:
        self.topics: list[str] = []
        self.types: dict[str, str] = {}
        self.messages: list[tuple[str, bytes, int]] = []
        self.is_open = True

    def advertise(self, published: PublishedTopic) -> None:
        self.topics.append(published.topic.name)
        self.types[published.topic.name] = published.topic.type
        assert published.schema == "" or published.schema == schema_text(published.topic.type)

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        self.messages.append((topic_name, cdr, time_ns))
        return True

    def close(self) -> None:
        self.is_open = False


def test_a_publisher_under_other_names() -> None:
    inner = Collector()
    publisher = RenamingPublisher(inner, "carla_ros_bridge")
    for topic in (VehicleTopics("ego", "roof").lidar_points, VehicleTopics("ego").objects):
        publisher.advertise(PublishedTopic(topic, ""))
        assert publisher.publish(topic.name, b"x", 3)
    publisher.close()
    names = ["/carla/ego/roof", "/ego/ground_truth/objects"]
    assert inner.topics == names
    assert inner.messages == [(name, b"x", 3) for name in names]
    assert not inner.is_open


@pytest.mark.parametrize("names", ["carla_ros_bridge", "advpipe"])
def test_images_are_raw_where_the_bridges_are(names: str) -> None:
    inner = Collector()
    publisher = RenamingPublisher(inner, names)
    topic = VehicleTopics("ego").camera_image("front", "rgb")
    publisher.advertise(PublishedTopic(topic, schema_text(topic.type)))
    grey = np.full((8, 12, 3), 90, np.uint8)
    ours = serialise(jpeg_message(7, "ego/front_optical_frame", grey, 95), topic.type)
    publisher.publish(topic.name, ours, 3)
    ((name, cdr, _),) = inner.messages
    if names == "advpipe":
        assert (name, inner.types[name], cdr) == (topic.name, topic.type, ours)
    else:
        assert inner.types[name] == "sensor_msgs/msg/Image"
        assert bridge_message(topic.type, ours) == cdr != ours


@pytest.mark.parametrize(
    ("topic", "name"),
    [
        ("/ego/imu", "/carla/ego/imu"),
        ("/ego/gnss/fix", "/carla/ego/gnss"),
        ("/ego/ground_truth/odometry", "/carla/ego/odometry"),
        ("/ego/front/image/compressed", "/carla/ego/front/image"),
        ("/ego/front/camera_info", "/carla/ego/front/camera_info"),
        ("/ego/front/depth/compressed", "/carla/ego/depth_front/image"),
        ("/ego/rgb_front/depth/compressed", "/carla/ego/depth_front/image"),
        ("/ego/front/semantic_segmentation/compressed", "/carla/ego/semantic_segmentation_front/image"),
        ("/ego/front/instance_segmentation/compressed", "/carla/ego/instance_segmentation_front/image"),
        ("/ego/ground_truth/lidar/semantic_points", "/carla/ego/semantic_lidar"),
        ("/ego/radar/points", "/carla/ego/radar"),
        ("/ego/radar/scan", "/ego/radar/scan"),
        ("/ego/ground_truth/front/instances", "/ego/ground_truth/front/instances"),
        ("/ego/odometry", "/ego/odometry"),
        ("/clock", "/clock"),
    ],
)
def test_names(topic: str, name: str) -> None:
    assert published_name(topic, "carla_ros_bridge") == name
    assert published_name(topic, "advpipe") == topic


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('{"recording": {"names": "carla_ros_bridge"}}', "carla_ros_bridge"),
        ('{"recording": {}}', "advpipe"),
        ('{"recording": {"names": "of_a_later_release"}}', "advpipe"),
        (None, "advpipe"),
    ],
)
def test_the_bag_says_under_which_names(tmp_path: Path, text: str | None, names: str) -> None:
    with BagWriter(tmp_path / "bag", provenance={"kind": "clean"}) as bag:
        if text is not None:
            bag.write(SCENARIO_INFO, string(text), 1)
        else:
            bag.write(Topic("/note", "std_msgs/msg/String"), string(""), 1)
    assert published_names(BagReader(tmp_path / "bag")) == names


def test_only_another_preset_is_in_the_resolved_scenario() -> None:
    """Drives without it are recorded with the same bytes as before there was one."""
    assert "names" not in dump_scenario(load_scenario("smoke"))
    assert "names: carla_ros_bridge" in dump_scenario(
        load_scenario("smoke", {"recording.names": "carla_ros_bridge"})
    )
    assert "carla" not in dump_scenario(load_scenario("smoke"))
    assert "server: localhost:2000" in dump_scenario(load_scenario("smoke", {"world": "carla"}))
