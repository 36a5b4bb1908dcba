"""How ROS 2 nodes see ours: another process, with types of its own, reads what `ros2 node list` reads."""

import json
import subprocess
import sys

import pytest
from dds_process import new_domain

from advpipe.pipeline.mcap.channel import Topic

pytest.importorskip("cyclonedds")

from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.ros2 import Ros2Publisher
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.ros2_subscriber import Ros2Subscriber
from advpipe.pipeline.messages.types import schema_text


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("distribution", "id_bytes"),
    [("", 16), pytest.param("jazzy", 16, marks=pytest.mark.nightly), ("humble", 24)],
)
def test_the_node_and_its_topics_are_announced(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, distribution: str, id_bytes: int
) -> None:
    monkeypatch.setenv("ROS_DISTRO", distribution)
    domain = new_domain()
    node = Ros2Node(domain, "lo", "tester")
    topic = Topic("/words", "std_msgs/msg/String")
    publisher = Ros2Publisher(node)
    publisher.advertise(PublishedTopic(topic, schema_text(topic.type)))
    subscriber = Ros2Subscriber(node)
    subscriber.subscribe(Topic("/heard", topic.type), 10, is_reliable=True)
    gid = node.participant.guid.bytes.hex()
    reader = request.config.rootpath / "tests" / "dds_nodes.py"
    command = [sys.executable, str(reader), str(domain), str(id_bytes)]
    seen = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    subscriber.close()
    publisher.close()
    assert seen["nodes"] == [["/", "tester", 1, 1]]
    assert seen["gid"] == gid.ljust(2 * id_bytes, "0")
    assert seen["writers"][0].startswith(gid[:24])
    assert "enclave=/;" in seen["users"].values()
