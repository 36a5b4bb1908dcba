"""What `ros2 node list` reads, in a process of its own with types written by hand; prints a JSON document.

Arguments: the domain, and how many bytes an identifier has.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
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


def main() -> None:
    domain = Domain(int(sys.argv[1]), LOOPBACK)
    participant = DomainParticipant(int(sys.argv[1]))
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal)
    reader = DataReader(participant, Topic(participant, "ros_discovery_info", Info), qos=qos)
    people = BuiltinDataReader(participant, BuiltinTopicDcpsParticipant)
    found, users, end = None, {}, time.monotonic() + 30
    while time.monotonic() < end and (
        found is None or len(found.node_entities_info_seq[0].reader_gid_seq) < 1
    ):
        for one in people.take(10):
            if one.qos is not None and Policy.Userdata in one.qos:
                users[str(one.key)] = bytes(one.qos[Policy.Userdata].data).decode()
        found = (reader.take(10) or [found])[-1]
        time.sleep(0.05)
    nodes = [
        [n.node_namespace, n.node_name, len(n.reader_gid_seq), len(n.writer_gid_seq)]
        for n in found.node_entities_info_seq
    ]
    gids = [bytes(g.data).hex() for g in found.node_entities_info_seq[0].writer_gid_seq]
    del domain
    print(json.dumps({"nodes": nodes, "gid": bytes(found.gid.data).hex(), "writers": gids, "users": users}))


main()
