"""The channels of a bag: names, types, quality of service, and messages as bytes."""

from __future__ import annotations

from dataclasses import dataclass

from rosbags.interfaces import Qos

from advpipe.pipeline.mcap.qos import keep_last


@dataclass(frozen=True)
class Topic:
    """One channel of a bag.

    type: the name of the message type. qos: the profiles that its publishers offer, which rosbag2 uses when
    it plays the bag. type_hash: RIHS01 hash of the type if another tool's bag states it; "" for a type that
    advpipe defines (`pipeline/messages/types.py`).
    """

    name: str
    type: str
    qos: tuple[Qos, ...] = keep_last(10)
    type_hash: str = ""


StampedCdr = tuple[Topic, bytes, int]
"""A topic, a serialised message for it, and its stamp in nanoseconds."""


@dataclass(frozen=True)
class TopicInfo:
    """A bag's information on one of its topics: message type, QoS profiles and number of messages."""

    type: str
    qos: tuple[Qos, ...]
    count: int


@dataclass(frozen=True)
class RawMessage:
    """One message as stored in a bag: `cdr` is its serialised body, `schema` the definition of its type."""

    topic: Topic
    schema: str
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    schema_encoding: str = "ros2msg"
