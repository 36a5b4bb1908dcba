"""Publishes to a ROS 2 graph by DDS, without ROS 2 installed."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.live.dds_types import DdsType
from advpipe.pipeline.live.offered_qos import offered_qos
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.writer_qos import writer_qos
from advpipe.pipeline.mcap.channel import Topic

_FLUSH_S = 2.0


@dataclass(frozen=True)
class _Writer:
    topic: Topic
    kind: DdsType
    writer: Any
    is_reliable: bool


class Ros2Publisher:
    """Publishes topics with the names, types, QoS and type hashes under which ROS 2 nodes expect them.

    node: under whose name it publishes; `close` closes it, too. A reliable subscriber that does not keep up
    misses messages that are older than the topic's history, as with every publisher that keeps the last
    ones; where Cyclone's own buffers are full, `publish` waits for up to `BLOCK_S` and then drops the
    message.
    """

    def __init__(self, node: Ros2Node) -> None:
        self._node = node
        self._writers: dict[str, _Writer] = {}

    def advertise(self, published: PublishedTopic) -> None:
        """See `Publisher`."""
        topic, participant = published.topic, self._node.participant
        kind, offered = DdsType(published), offered_qos(topic)
        try:
            dds_topic = DdsTopic(participant, dds_topic_name(topic), kind.struct)
            writer = DataWriter(participant, dds_topic, qos=writer_qos(offered, kind.hash))
        except DDSException as error:
            raise UnpublishableTypeError(
                f"{topic.name} cannot be published to ROS 2: DDS refuses its name, its type or its QoS"
            ) from error
        self._writers[topic.name] = _Writer(topic, kind, writer, offered.is_reliable)
        self._node.add_writer(writer)

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        """See `Publisher`; subscribers see the present as the time of sending, as from `ros2 bag play`."""
        one = self._writers[topic_name]
        try:
            one.writer.write(one.kind.sample(cdr))
        except DDSException as error:
            if error.code == DDSException.DDS_RETCODE_TIMEOUT:
                return False
            raise AdvpipeError(
                f"a message of {topic_name} at {time_ns} ns is not a valid {one.topic.type}"
            ) from None
        return True

    def subscribers(self, topic_name: str) -> int:
        """How many subscribers an announced topic has."""
        return len(self._writers[topic_name].writer.matched_sub)

    def close(self) -> None:
        """See `Publisher`: waits up to two seconds for reliable subscribers."""
        end_s = time.monotonic() + _FLUSH_S
        for one in self._writers.values():
            if one.is_reliable:
                # At the end of this time, Cyclone 11's Python raises AttributeError for want of a constant.
                with suppress(AttributeError):
                    one.writer.wait_for_acks(duration(seconds=max(end_s - time.monotonic(), 0.001)))
        self._writers.clear()
        self._node.close()


def dds_topic_name(topic: Topic) -> str:
    """The DDS name of a ROS 2 topic, such as `rt/tf` for `/tf`."""
    bare = any(profile.avoid_ros_namespace_conventions for profile in topic.qos)
    return topic.name.removeprefix("/") if bare else f"rt/{topic.name.removeprefix('/')}"
