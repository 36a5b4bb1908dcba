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

READER = """
import json, sys, time
from dataclasses import dataclass
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant, BuiltinTopicDcpsPublication
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

sys.path.insert(0, sys.argv[3])
from dds_subscriber import LOOPBACK

N = int(sys.argv[2])

@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: types.array[types.uint8, N]

@dataclass
class Node(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: types.bounded_str[256]
    node_name: types.bounded_str[256]
    reader_gid_seq: types.sequence[Gid]
    writer_gid_seq: types.sequence[Gid]

@dataclass
class Info(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: types.sequence[Node]

domain = Domain(int(sys.argv[1]), LOOPBACK)
participant = DomainParticipant(int(sys.argv[1]))
qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal)
reader = DataReader(participant, Topic(participant, "ros_discovery_info", Info), qos=qos)
people = BuiltinDataReader(participant, BuiltinTopicDcpsParticipant)
found, users, end = None, {}, time.monotonic() + 30
while time.monotonic() < end and (found is None or len(found.node_entities_info_seq[0].reader_gid_seq) < 1):
    for one in people.take(10):
        if one.qos is not None and Policy.Userdata in one.qos:
            users[str(one.key)] = bytes(one.qos[Policy.Userdata].data).decode()
    for found in reader.take(10): pass
    time.sleep(0.05)
nodes = [[n.node_namespace, n.node_name, len(n.reader_gid_seq), len(n.writer_gid_seq)]
         for n in found.node_entities_info_seq]
gids = [bytes(g.data).hex() for g in found.node_entities_info_seq[0].writer_gid_seq]
print(json.dumps({"nodes": nodes, "gid": bytes(found.gid.data).hex(), "writers": gids, "users": users}))
"""


@pytest.mark.oracle
@pytest.mark.parametrize(("distribution", "id_bytes"), [("", 16), ("jazzy", 16), ("humble", 24)])
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
    tests = str(request.config.rootpath / "tests")
    command = [sys.executable, "-c", READER, str(domain), str(id_bytes), tests]
    seen = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    subscriber.close()
    publisher.close()
    assert seen["nodes"] == [["/", "tester", 1, 1]]
    assert seen["gid"] == gid.ljust(2 * id_bytes, "0")
    assert seen["writers"][0].startswith(gid[:24])
    assert "enclave=/;" in seen["users"].values()
