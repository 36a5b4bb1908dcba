"""Publishes to a ROS 2 graph by DDS, without ROS 2 installed."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic as DdsTopic
from cyclonedds.util import duration
from rosbags.interfaces import QosLiveliness

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.live.dds_domain import DdsDomain
from advpipe.pipeline.live.dds_types import DdsType
from advpipe.pipeline.live.offered_qos import OfferedQos, offered_qos
from advpipe.pipeline.live.publisher import PublishedTopic, UnpublishableTypeError
from advpipe.pipeline.mcap.channel import Topic

BLOCK_S = 0.02
"""How long a reliable writer waits for a slow subscriber before a message is dropped."""

_FLUSH_S = 2.0


@dataclass(frozen=True)
class _Writer:
    topic: Topic
    kind: DdsType
    writer: Any
    is_reliable: bool


class Ros2Publisher:
    """Publishes topics with the names, types, QoS and type hashes under which ROS 2 nodes expect them.

    domain_id: ROS_DOMAIN_ID of the nodes. interface: of the network; None for the one that ROS 2 would take.
    A reliable subscriber that does not keep up misses messages that are older than the topic's history, as
    with every publisher that keeps the last ones; where Cyclone's own buffers are full, `publish` waits for
    up to `BLOCK_S` and then drops the message.
    """

    def __init__(self, domain_id: int = 0, interface: str | None = None) -> None:
        self._domain = DdsDomain(domain_id, interface)
        self._writers: dict[str, _Writer] = {}

    def advertise(self, published: PublishedTopic) -> None:
        """See `Publisher`."""
        topic, participant = published.topic, self._domain.participant
        kind, offered = DdsType(published), offered_qos(topic)
        try:
            dds_topic = DdsTopic(participant, dds_topic_name(topic), kind.struct)
            writer = DataWriter(participant, dds_topic, qos=writer_qos(offered, kind.hash))
        except DDSException as error:
            raise UnpublishableTypeError(
                f"{topic.name} cannot be published to ROS 2: DDS refuses its name, its type or its QoS"
            ) from error
        self._writers[topic.name] = _Writer(topic, kind, writer, offered.is_reliable)

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
        self._domain.close()


def dds_topic_name(topic: Topic) -> str:
    """The DDS name of a ROS 2 topic, such as `rt/tf` for `/tf`."""
    bare = any(profile.avoid_ros_namespace_conventions for profile in topic.qos)
    return topic.name.removeprefix("/") if bare else f"rt/{topic.name.removeprefix('/')}"


def writer_qos(offered: OfferedQos, type_hash: str) -> Qos:
    """The QoS of a DDS writer; its user data has the type's hash, where ROS 2 from Iron on looks for it."""
    history = Policy.History.KeepLast(offered.depth)
    policies = [
        history,
        Policy.Reliability.Reliable(duration(seconds=BLOCK_S))
        if offered.is_reliable
        else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if offered.is_latched else Policy.Durability.Volatile,
        Policy.WriterDataLifecycle(autodispose=False),  # as ROS 2: what was sent stays valid
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={type_hash};".encode()),
    ]
    if offered.is_latched:  # what late subscribers receive
        policies.append(Policy.DurabilityService(0, history, -1, -1, -1))
    if offered.deadline_ns is not None:
        policies.append(Policy.Deadline(offered.deadline_ns))
    if offered.lifespan_ns is not None:
        policies.append(Policy.Lifespan(offered.lifespan_ns))
    if offered.liveliness == QosLiveliness.MANUAL_BY_TOPIC:
        policies.append(Policy.Liveliness.ManualByTopic(_lease(offered)))
    elif offered.lease_ns is not None:
        policies.append(Policy.Liveliness.Automatic(offered.lease_ns))
    return Qos(*policies)


def _lease(offered: OfferedQos) -> int:
    return duration(infinite=True) if offered.lease_ns is None else offered.lease_ns
