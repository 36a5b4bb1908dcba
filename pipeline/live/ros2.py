"""Publishes to a ROS 2 graph by DDS, without ROS 2 installed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.live.acknowledgements import AcknowledgementWatch
from advpipe.pipeline.live.dds_types import DdsType
from advpipe.pipeline.live.offered_qos import offered_qos
from advpipe.pipeline.live.publisher import Missed, PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.writer_qos import writer_qos
from advpipe.pipeline.mcap.channel import Topic


@dataclass(frozen=True)
class _Writer:
    topic: Topic
    kind: DdsType
    writer: Any
    watch: AcknowledgementWatch | None


class Ros2Publisher:
    """Publishes topics with the names, types, QoS and type hashes under which ROS 2 nodes expect them.

    node: under whose name it publishes; `close` closes it, too. A reliable subscriber that does not keep up
    misses messages that are older than the topic's history, as with every publisher that keeps the last
    ones, and `missed` counts them; where Cyclone's own buffers are full, `publish` waits for up to `BLOCK_S`
    and then drops the message. What a subscriber's program does not take from its own history, nobody but the
    subscriber knows.
    """

    def __init__(self, node: Ros2Node) -> None:
        self._node = node
        self._writers: dict[str, _Writer] = {}
        self._watches: list[AcknowledgementWatch] = []

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
        watch = None
        if offered.is_reliable:
            watch = AcknowledgementWatch(topic.name, offered.depth, partial(_is_acknowledged, writer))
            self._watches.append(watch)
        self._writers[topic.name] = _Writer(topic, kind, writer, watch)
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
        if one.watch is not None:
            one.watch.count(len(cdr))
        return True

    def subscribers(self, topic_name: str) -> int:
        """How many subscribers an announced topic has."""
        return len(self._writers[topic_name].writer.matched_sub)

    def missed(self) -> Missed:
        """See `Publisher`; only of reliable subscribers, as others acknowledge nothing."""
        return Missed({watch.topic_name: watch.missed for watch in self._watches if watch.missed})

    def close(self) -> None:
        """See `Publisher`: waits up to `PATIENCE_S`, or twice as long, for reliable subscribers."""
        for watch in self._watches:
            watch.end()
        for watch in self._watches:
            watch.join()
        self._writers.clear()
        self._node.close()


def _is_acknowledged(writer: Any, timeout_s: float) -> bool:
    try:
        return bool(writer.wait_for_acks(duration(seconds=timeout_s)))
    except AttributeError:  # at the end of the time: Cyclone 11's Python lacks the constant for it
        return False


def dds_topic_name(topic: Topic) -> str:
    """The DDS name of a ROS 2 topic, such as `rt/tf` for `/tf`."""
    bare = any(profile.avoid_ros_namespace_conventions for profile in topic.qos)
    return topic.name.removeprefix("/") if bare else f"rt/{topic.name.removeprefix('/')}"
