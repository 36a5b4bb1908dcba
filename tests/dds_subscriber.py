"""A DDS subscriber in a process of its own, whose types are written by hand: what a ROS 2 node would see.

Prints one JSON document a line: `ready`, then each sample, and at the end the publications that it found.
"""

import argparse
import hashlib
import json
import time
from dataclasses import dataclass
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import ReadCondition, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.internal import InvalidSample
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/>
</Interfaces></General><Internal><SocketReceiveBufferSize min="4MB"/></Internal><Discovery>
<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: types.int32
    nanosec: types.uint32


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class PointField(IdlStruct, typename="sensor_msgs::msg::dds_::PointField_"):
    name: str
    offset: types.uint32
    datatype: types.uint8
    count: types.uint32


@dataclass
class PointCloud2(IdlStruct, typename="sensor_msgs::msg::dds_::PointCloud2_"):
    header: Header
    height: types.uint32
    width: types.uint32
    fields: types.sequence[PointField]
    is_bigendian: bool
    point_step: types.uint32
    row_step: types.uint32
    data: types.sequence[types.uint8]
    is_dense: bool


def plain(sample: Any) -> dict[str, Any]:
    """What the test compares with the bag."""
    if isinstance(sample, Clock):
        return {"stamp_ns": sample.clock.sec * 10**9 + sample.clock.nanosec}
    if isinstance(sample, String):
        return {"data": sample.data}
    stamp = sample.header.stamp
    return {
        "stamp_ns": stamp.sec * 10**9 + stamp.nanosec,
        "frame_id": sample.header.frame_id,
        "width": sample.width,
        "fields": [field.name for field in sample.fields],
        "sha256": hashlib.sha256(bytes(sample.data)).hexdigest(),
    }


TYPES = {"clock": Clock, "string": String, "cloud": PointCloud2}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("domain", type=int)
    parser.add_argument("--topic", nargs=3, action="append", metavar=("NAME", "TYPE", "QOS"), default=[])
    parser.add_argument("--idle", type=float, default=3.0, help="Ends so long after the last sample.")
    parser.add_argument("--slow", type=float, default=0.0, help="Reads nothing for so long.")
    parser.add_argument("--patience", type=float, default=60.0, help="Ends so long after no first sample.")
    parser.add_argument("--security", default="", help="The section of Cyclone's configuration.")
    given = parser.parse_args()
    domain = Domain(given.domain, LOOPBACK.replace("</Domain>", f"{given.security}</Domain>"))
    participant = DomainParticipant(given.domain)
    found = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    readers = {}
    for name, kind, qos in given.topic:
        policies = [Policy.History.KeepAll if given.slow else Policy.History.KeepLast(100)]
        if given.slow:  # takes nothing beyond one sample
            policies.append(Policy.ResourceLimits(1, 1, 1))
        reliable = Policy.Reliability.Reliable(duration(seconds=1))
        policies.append(Policy.Reliability.BestEffort if qos == "best_effort" else reliable)
        if qos == "latched":
            policies.append(Policy.Durability.TransientLocal)
        readers[name] = DataReader(participant, Topic(participant, name, TYPES[kind]), qos=Qos(*policies))
    waiting = WaitSet(participant)
    for reader in readers.values():
        waiting.attach(ReadCondition(reader, 0xFFFF))
    print(json.dumps({"ready": True}), flush=True)
    time.sleep(given.slow)
    publications: dict[str, dict[str, Any]] = {}
    last_s, is_first = time.monotonic(), True
    while time.monotonic() - last_s < (given.patience if is_first else given.idle):
        waiting.wait(duration(milliseconds=100))
        for name, reader in readers.items():
            for sample in reader.take(20):
                if isinstance(sample, InvalidSample):  # tells that a writer is gone
                    continue
                last_s, is_first = time.monotonic(), False
                print(json.dumps({"topic": name, **plain(sample)}), flush=True)
        for one in found.take(100):
            qos = getattr(one, "qos", None)
            if qos is not None and one.topic_name.startswith("rt/"):
                publications[one.topic_name] = {
                    "type": one.type_name,
                    "user_data": bytes(qos[Policy.Userdata].data).decode() if Policy.Userdata in qos else "",
                    "qos": [repr(policy) for policy in qos],
                }
    print(json.dumps({"publications": publications}), flush=True)
    del domain


if __name__ == "__main__":
    main()
