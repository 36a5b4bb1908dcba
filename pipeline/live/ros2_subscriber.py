"""Receives messages of a ROS 2 graph by DDS, as bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from cyclonedds._clayer import ddspy_take
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.live.dds_types import DdsType
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.ros2 import dds_topic_name
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.types import schema_text

_ANY = ViewState.Any | SampleState.Any | InstanceState.Any
_AT_ONCE = 32
"""Messages of a topic that are taken before those of the next."""


class ReceivedCdr(NamedTuple):
    """A message as it came: its body in CDR, with the header of four bytes."""

    topic_name: str
    cdr: bytes


@dataclass(frozen=True)
class GraphPublisher:
    """A publisher in the graph. type: its DDS type name."""

    type: str
    is_reliable: bool
    is_latched: bool


@dataclass(frozen=True)
class _Reader:
    topic: Topic
    reader: Any
    condition: Any


class Ros2Subscriber:
    """Subscribes to topics under a node's name; for one thread. The node is closed by somebody else."""

    def __init__(self, node: Ros2Node) -> None:
        self._node = node
        self._readers: list[_Reader] = []
        self._waiting = WaitSet(node.participant)
        self._found = BuiltinDataReader(node.participant, BuiltinTopicDcpsPublication)
        self._publishers: dict[Any, tuple[str, GraphPublisher]] = {}

    def publishers(self, topic: Topic) -> list[GraphPublisher]:
        """The publishers of a topic that were found so far, whatever their type."""
        for one in self._found.take(_AT_ONCE):
            if getattr(one, "qos", None) is not None:  # otherwise the publisher is gone
                found = GraphPublisher(
                    one.type_name,
                    one.qos[Policy.Reliability] != Policy.Reliability.BestEffort,
                    one.qos[Policy.Durability] == Policy.Durability.TransientLocal,
                )
                self._publishers[one.key] = one.topic_name, found
        return [found for name, found in self._publishers.values() if name == dds_topic_name(topic)]

    def subscribe(self, topic: Topic, depth: int, *, is_reliable: bool, is_latched: bool = False) -> None:
        """Subscribe to a topic of a type that advpipe knows; the reader keeps `depth` messages in wait.

        Raises UsageError for a name that DDS refuses.
        """
        kind = DdsType(PublishedTopic(topic, schema_text(topic.type)))
        policies = [
            Policy.History.KeepLast(depth),
            Policy.Reliability.Reliable(0) if is_reliable else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
            Policy.Userdata(f"typehash={kind.hash};".encode()),
        ]
        try:
            dds_topic = DdsTopic(self._node.participant, dds_topic_name(topic), kind.struct)
            reader = DataReader(self._node.participant, dds_topic, qos=Qos(*policies))
        except DDSException:
            raise UsageError(
                f"{topic.name} cannot be subscribed to: DDS refuses its name or its type"
            ) from None
        condition = ReadCondition(reader, _ANY)
        self._waiting.attach(condition)
        self._node.add_reader(reader)
        self._readers.append(_Reader(topic, reader, condition))

    def receive(self, timeout_s: float) -> Iterator[ReceivedCdr]:
        """The messages that have come, after a wait of up to this time if there are none."""
        self._waiting.wait(duration(seconds=timeout_s))
        for one in self._readers:
            taken = ddspy_take(one.reader._ref, _ANY, _AT_ONCE)
            if not isinstance(taken, list):
                continue
            for data, info in taken:
                if info.valid_data:
                    yield ReceivedCdr(one.topic.name, data)

    def close(self) -> None:
        """Withdraw all subscriptions."""
        self._readers.clear()
        del self._waiting, self._found
