"""Receiving from a publisher in another process."""

import subprocess
import sys
import time

import pytest
from dds_process import new_domain

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.topics import CLOCK, VehicleTopics

pytest.importorskip("cyclonedds")

from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.ros2_subscriber import GraphPublisher, Ros2Subscriber

SAMPLE = shipped_sample() / "clean"
POINTS = VehicleTopics().lidar_points


@pytest.mark.nightly
@pytest.mark.oracle
def test_what_is_played_is_received_byte_for_byte() -> None:
    domain = new_domain()
    subscriber = Ros2Subscriber(node := Ros2Node(domain, "lo", "tester"))
    command = [sys.executable, "-m", "advpipe", "play", str(SAMPLE), "--ros2", "--interface", "lo", "-q"]
    came: dict[str, list[bytes]] = {POINTS.name: [], CLOCK.name: []}
    with subprocess.Popen([*command, "--domain", str(domain), "--delay", "4"]) as player:
        end_s = time.monotonic() + 60
        while not subscriber.publishers(POINTS) or not subscriber.publishers(CLOCK):
            assert time.monotonic() < end_s
            time.sleep(0.05)
        assert subscriber.publishers(POINTS) == [
            GraphPublisher("sensor_msgs::msg::dds_::PointCloud2_", is_reliable=True, is_latched=False)
        ]
        assert [one.is_reliable for one in subscriber.publishers(CLOCK)] == [False]
        subscriber.subscribe(POINTS, 5, is_reliable=True)
        subscriber.subscribe(CLOCK, 5, is_reliable=False)
        while player.poll() is None or time.monotonic() < end_s - 59:
            for one in subscriber.receive(0.05):
                came[one.topic_name].append(one.cdr)
        for one in subscriber.receive(0.05):
            came[one.topic_name].append(one.cdr)
    subscriber.close()
    node.close()
    for name, cdrs in came.items():
        sent = [raw.cdr for raw in BagReader(SAMPLE).raw_messages([name])]
        assert [cdr[4 : len(raw)] for cdr, raw in zip(cdrs, sent, strict=True)] == [raw[4:] for raw in sent]
        assert all(len(cdr) - len(raw) < 4 for cdr, raw in zip(cdrs, sent, strict=True)), "DDS fills up to 4"


@pytest.mark.oracle
def test_a_name_that_dds_refuses() -> None:
    subscriber = Ros2Subscriber(node := Ros2Node(new_domain(), "lo"))
    with pytest.raises(UsageError, match=r"^/two words cannot be subscribed to: DDS refuses"):
        subscriber.subscribe(Topic("/two words", "std_msgs/msg/String"), 5, is_reliable=True)
    subscriber.close()
    node.close()
