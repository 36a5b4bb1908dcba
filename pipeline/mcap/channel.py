"""The channels of a bag: names, types, quality of service, and messages as bytes."""

from __future__ import annotations

from dataclasses import dataclass

from rosbags.interfaces import Qos

from advpipe.pipeline.mcap.qos import keep_last


@dataclass(frozen=True)
class Topic:
    """One channel of a bag.

    qos: the profiles offered by its publishers; rosbag2 republishes with them.
    type_hash: RIHS01 hash of the type where another tool's bag states it; "" for a type of ours
    (`pipeline/messages/types.py`).
    """

    name: str
    type: str
    qos: tuple[Qos, ...] = keep_last(10)
    type_hash: str = ""


StampedCdr = tuple[Topic, bytes, int]
"""A topic, a serialised message for it, and its stamp in nanoseconds."""


@dataclass(frozen=True)
class TopicInfo:
    """What a bag says about one of its topics."""

    type: str
    qos: tuple[Qos, ...]
    count: int


@dataclass(frozen=True)
class RawMessage:
    """One message as it is stored in a bag: `cdr` is its serialised body, `schema` its type's definition."""

    topic: Topic
    schema: str
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    schema_encoding: str = "ros2msg"
