"""The contents of a bag, for its card and specifications; read in one pass over its messages."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from advpipe.pipeline.bag.carried import CLOUD_TYPE, CarriedSensor, is_lidar, sensors_by_topic
from advpipe.pipeline.bag.inspect import BagDescription, describe
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.qos import is_latched
from advpipe.pipeline.messages.build import NS_PER_S
from advpipe.pipeline.messages.debug import is_debug
from advpipe.pipeline.messages.topics import TF, TF_STATIC, is_truth

_HEADER_TYPES = ("std_msgs/Header", "std_msgs/msg/Header", "Header")
_HEADER = struct.Struct("<iII")  # seconds, nanoseconds, length of the frame's name
_MOST_FRAMES = 8


@dataclass
class TopicFacts:
    """One topic: the log times of its messages, and their headers.

    max_gap_ns: the longest time between two messages. is_latched: whether late subscribers get the last
    message. is_counted: whether the sequence numbers go up by one. has_good_stamps: whether every message
    has a header, with stamps that never repeat or go back. frames: the header's frames, at most eight.
    """

    name: str
    type: str
    schema: str
    schema_encoding: str
    is_latched: bool = False
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    max_gap_ns: int = 0
    is_counted: bool = True
    has_good_stamps: bool = True
    frames: list[str] = field(default_factory=list)
    _sequence: int = -1
    _stamp_ns: int = 0

    @property
    def rate_hz(self) -> float | None:
        """Mean over the topic's own span; None for fewer than two messages."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * NS_PER_S / span_ns if span_ns > 0 else None

    def add(self, raw: RawMessage) -> None:
        """Count the topic's next message."""
        if self.count:
            self.max_gap_ns = max(self.max_gap_ns, raw.log_time_ns - self.last_ns)
            self.is_counted &= raw.sequence == (self._sequence + 1) % 2**32
        else:
            self.first_ns = raw.log_time_ns
        self.count += 1
        self.last_ns, self._sequence = raw.log_time_ns, raw.sequence
        self._add_header(raw.cdr)

    def _add_header(self, cdr: bytes) -> None:
        if not self.has_good_stamps:
            return
        if len(cdr) < 16 or cdr[1] != 1 or not _starts_with_header(self.schema):
            self.has_good_stamps = False
            return
        seconds, nanoseconds, length = _HEADER.unpack_from(cdr, 4)
        stamp_ns = seconds * NS_PER_S + nanoseconds
        self.has_good_stamps = stamp_ns > self._stamp_ns
        self._stamp_ns = stamp_ns
        frame = cdr[16 : 15 + length].decode("utf-8", "replace")
        if frame and frame not in self.frames and len(self.frames) < _MOST_FRAMES:
            self.frames.append(frame)


@lru_cache(256)
def _starts_with_header(schema: str) -> bool:
    """Whether a type's first field, after comments and constants, is a header."""
    for line in schema.splitlines():
        tokens = line.split("#")[0].split()
        if tokens and "=" not in line.split("#")[0]:
            return tokens[0] in _HEADER_TYPES and tokens[1:] == ["header"]
    return False


@dataclass
class TransformSpan:
    """When a transform exists: the stamps of its first and last message, and the longest gap between two."""

    is_static: bool
    first_ns: int
    last_ns: int
    max_gap_ns: int = 0


@dataclass(frozen=True)
class BagFacts:
    """One bag of a data set.

    transforms: by parent and child frame. sensors: by topic; None in another tool's bag. description: the
    output of `advpipe inspect`.
    """

    path: Path
    description: BagDescription
    provenance: Provenance
    topics: Mapping[str, TopicFacts]
    transforms: Mapping[tuple[str, str], TransformSpan]
    sensors: Mapping[str, CarriedSensor] | None

    @property
    def is_attack(self) -> bool:
        """Whether the bag is adversarial; other bags beside the clean one are other drives."""
        return self.provenance.is_attack

    @property
    def lidars(self) -> list[TopicFacts]:
        """The topics with LiDAR clouds; in another tool's bag, with any point clouds."""
        clouds = [one for one in self.topics.values() if one.type == CLOUD_TYPE and not is_debug(one.name)]
        if self.sensors is None:
            return clouds
        return [topic for topic in clouds if is_lidar(self.sensors.get(topic.name))]

    @property
    def root_frame(self) -> str:
        """The root of the frames; `map` if there is none or several."""
        children = {child for _, child in self.transforms}
        roots = sorted({parent for parent, _ in self.transforms} - children)
        return roots[0] if len(roots) == 1 else "map"

    @property
    def truths(self) -> list[str]:
        """Topics with the true boxes."""
        return [
            name
            for name, topic in self.topics.items()
            if topic.type.endswith("/Detection3DArray") and is_truth(name)
        ]


def read_facts(path: Path) -> BagFacts:
    """Read a whole bag and check all its checksums; raises AdvpipeError for a damaged bag."""
    description, reader = describe(path), BagReader(path, debug=True)
    topics: dict[str, TopicFacts] = {}
    transforms: dict[tuple[str, str], TransformSpan] = {}
    for raw in reader.raw_messages():
        name = raw.topic.name
        if name not in topics:
            topic, latched = raw.topic, is_latched(raw.topic.qos)
            topics[name] = TopicFacts(name, topic.type, raw.schema, raw.schema_encoding, latched)
        topics[name].add(raw)
        if name in (TF.name, TF_STATIC.name):
            _add_transforms(transforms, reader, raw)
    by_name, sensors = dict(sorted(topics.items())), sensors_by_topic(reader)
    return BagFacts(path, description, reader.provenance, by_name, transforms, sensors)


def _add_transforms(edges: dict[tuple[str, str], TransformSpan], reader: BagReader, raw: RawMessage) -> None:
    for transform in reader.decode(raw).transforms:
        pair = (transform.header.frame_id, transform.child_frame_id)
        stamp = transform.header.stamp
        stamp_ns = stamp.sec * NS_PER_S + stamp.nanosec
        if (edge := edges.get(pair)) is None:
            edges[pair] = TransformSpan(raw.topic.name == TF_STATIC.name, stamp_ns, stamp_ns)
        else:
            edge.max_gap_ns = max(edge.max_gap_ns, stamp_ns - edge.last_ns)
            edge.last_ns = stamp_ns
