"""What a channel of an .mcap file says of a ROS 2 topic."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

from mcap.records import Channel, Schema

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import qos_from_yaml

SCHEMA_LIMIT_BYTES = 1 << 18
"""The longest definition of a type that is read; the definition of the CAM has 28 kB."""

LONGEST_TOPIC = 255
"""The limit of ROS 2's middleware."""

_SCHEMA_ENCODINGS = ("ros2msg", "ros2idl")
_TYPE_NAME = re.compile(r"[A-Za-z]\w*(/[A-Za-z]\w*){1,3}", re.ASCII)
_qos = lru_cache(256)(qos_from_yaml)


def ros2_topic(path: Path, channel: Channel, schema: Schema) -> Topic:
    """The topic of a channel. Raises AdvpipeError for a channel that is not of a ROS 2 recording."""
    if len(channel.topic) > LONGEST_TOPIC or "\0" in channel.topic:
        raise AdvpipeError(
            f"{path}: {channel.topic[:40]!r}... is not a valid topic name ({len(channel.topic)} characters)"
        )
    if channel.message_encoding != "cdr":
        raise UsageError(
            f"{path}: {channel.topic} is encoded as {short_repr(channel.message_encoding)}; "
            "advpipe reads ROS 2 bags, where all topics are 'cdr'"
        )
    if schema.encoding not in _SCHEMA_ENCODINGS:
        raise UsageError(
            f"{path}: {channel.topic} has a schema encoded as {short_repr(schema.encoding)}, which is "
            "not a ROS 2 encoding"
        )
    if not _TYPE_NAME.fullmatch(schema.name):  # rosbags generates code from it
        raise AdvpipeError(
            f"{path}: {channel.topic} has {short_repr(schema.name)}, which is not a valid type name"
        )
    if len(schema.data) > SCHEMA_LIMIT_BYTES:
        raise AdvpipeError(
            f"{path}: the definition of {schema.name} has {len(schema.data)} bytes; at most "
            f"{SCHEMA_LIMIT_BYTES} are read"
        )
    try:
        qos = _qos(channel.metadata.get("offered_qos_profiles", ""))
    except ValueError as error:
        raise AdvpipeError(f"{path}: {channel.topic}: {error}") from None
    return Topic(
        name=channel.topic,
        type=schema.name,
        qos=qos,
        type_hash=channel.metadata.get("topic_type_hash", ""),
    )
