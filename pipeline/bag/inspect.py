"""What is in a bag: files, topics, clouds, road users, V2X, provenance and checksums."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from rosbags.interfaces import Qos, QosDurability

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_statistics import read_statistics
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.checksums import ChecksumCoverage, validate_checksums
from advpipe.pipeline.messages.build import NS_PER_S
from advpipe.pipeline.messages.topics import IGNORED_OBJECTS, VehicleTopics
from advpipe.pipeline.v2x.statistics import Statistics

_OBJECTS_TYPE, _COVERAGE_TYPE = VehicleTopics().objects.type, VehicleTopics().label_coverage.type
_LONG = ("scenario", "versions")  # provenance that the table leaves out; --json has it


@dataclass(frozen=True)
class TopicDescription:
    """rate_hz: 0 with fewer than two messages."""

    name: str
    type: str
    count: int
    rate_hz: float
    qos: str


@dataclass(frozen=True)
class ObjectCount:
    """boxes: over all messages. road_users: different ids among them."""

    class_name: str
    boxes: int
    road_users: int


@dataclass(frozen=True)
class UncountedLabels:
    """What an imported drive labels that counts neither way, over all messages.

    ignored: labelled objects by the source's class. regions: those in which nothing counts. partial: at how
    many instants only a part of the surroundings is labelled.
    """

    ignored: dict[str, int]
    regions: int
    partial: int

    def __bool__(self) -> bool:
        return bool(self.ignored or self.regions or self.partial)

    def lines(self) -> list[tuple[str, str]]:
        """What there is, each with its name."""
        lines = []
        if self.ignored:
            classes = ", ".join(f"{name} {count}" for name, count in self.ignored.items())
            lines.append(("ignored", f"{counted(sum(self.ignored.values()), 'box', 'boxes')} ({classes})"))
        if self.regions:
            lines.append(("ignored regions", str(self.regions)))
        if self.partial:
            lines.append(
                ("labelled view", f"a part of the surroundings, at {counted(self.partial, 'instant')}")
            )
        return lines


@dataclass(frozen=True)
class LidarDescription:
    """The clouds of one LiDAR, and their points."""

    topic: str
    clouds: int
    points_least: int
    points_mean: float
    points_most: int

    def __str__(self) -> str:
        points = f"{self.points_least} to {self.points_most} points, {self.points_mean:.0f} on average"
        return f"{self.clouds} of {points}"


@dataclass(frozen=True)
class BagDescription:
    """A summary of one bag; clouds and points are counted over all LiDARs, and for each in `lidars`.

    uncounted: labels that count neither way. v2x: None for a bag without such statistics.
    """

    path: str
    files: tuple[str, ...]
    bytes: int
    start_ns: int
    duration_s: float
    messages: int
    topics: tuple[TopicDescription, ...]
    clouds: int
    points_least: int
    points_mean: float
    points_most: int
    lidars: tuple[LidarDescription, ...]
    objects: tuple[ObjectCount, ...]
    uncounted: UncountedLabels
    v2x: Statistics | None
    provenance: dict[str, str]
    checksums: ChecksumCoverage

    def to_json(self) -> str:
        """All values as one JSON document."""
        return json.dumps(asdict(self), indent=2)

    def print(self) -> None:
        """Tables on standard output."""
        from rich.table import Column, Table

        from advpipe.pipeline.core.streams import plain_console

        facts = Table.grid(padding=(0, 2))
        for name, value in self._facts():
            facts.add_row(name, value)
        topics = Table("topic", "type", Column("messages", justify="right"), "rate", "QoS", box=None)
        for topic in self.topics:
            rate = f"{topic.rate_hz:.1f} Hz" if topic.rate_hz else ""
            topics.add_row(topic.name, topic.type.replace("/msg/", "/"), str(topic.count), rate, topic.qos)
        shown = plain_console()
        shown.width = max(shown.width, 110)  # a long line that a terminal wraps beats a folded name
        shown.print(facts)
        shown.print(topics)

    def _facts(self) -> list[tuple[str, str]]:
        facts = [
            ("bag", self.path),
            ("files", f"{', '.join(self.files)} ({self.bytes / 1e6:.1f} MB)"),
            ("duration", f"{self.duration_s:.1f} s from {_date(self.start_ns)}"),
            ("messages", str(self.messages)),
        ]
        several = len(self.lidars) > 1
        facts += [(f"clouds of {one.topic}" if several else "clouds", str(one)) for one in self.lidars]
        for item in self.objects:
            facts.append(
                (
                    item.class_name,
                    f"{counted(item.road_users, 'road user')}, {counted(item.boxes, 'box', 'boxes')}",
                )
            )
        facts += self.uncounted.lines()
        if self.v2x is not None:
            facts += self.v2x.lines()
        facts += [(key, value) for key, value in self.provenance.items() if key not in _LONG]
        return [*facts, ("checksums", str(self.checksums))]


def _date(stamp_ns: int) -> str:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%dT%H:%M:%S}.{nanoseconds // 1_000_000:03}Z"


@dataclass
class _TopicTally:
    """What is counted in one pass over the bag.

    lidars: the topics with LiDAR clouds. truth: the topics whose boxes are of road users.
    """

    lidars: frozenset[str]
    truth: frozenset[str]
    first_ns: dict[str, int] = field(default_factory=dict)
    last_ns: dict[str, int] = field(default_factory=dict)
    points: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    boxes: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    ids: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    ignored: Counter[str] = field(default_factory=Counter)
    regions: int = 0
    partial: int = 0

    def add(self, reader: BagReader, raw: RawMessage) -> None:
        self.first_ns.setdefault(raw.topic.name, raw.log_time_ns)
        self.last_ns[raw.topic.name] = raw.log_time_ns
        if raw.topic.name in self.lidars:
            self.points[raw.topic.name].append(len(reader.cloud(raw).cloud))
        elif raw.topic.name in self.truth:
            for detection in reader.decode(raw).detections:
                name = _class_of(detection)
                self.boxes[name] += 1
                self.ids[name].add(detection.id)

        elif raw.topic.name.endswith(f"/{IGNORED_OBJECTS}"):
            for detection in reader.decode(raw).detections:
                self.ignored[_class_of(detection)] += 1
        elif raw.topic.type == _COVERAGE_TYPE:
            coverage = reader.decode(raw)
            self.regions += len(coverage.ignored)
            self.partial += bool(coverage.labelled)

    def lidar(self, topic: str) -> LidarDescription:
        """What was counted of a LiDAR, or with the topic "" of all of them."""
        points = self.points.get(topic, []) if topic else [n for each in self.points.values() for n in each]
        mean = sum(points) / len(points) if points else 0.0
        return LidarDescription(topic, len(points), min(points, default=0), mean, max(points, default=0))

    def rate_hz(self, topic: str, count: int) -> float:
        span_ns = self.last_ns.get(topic, 0) - self.first_ns.get(topic, 0)
        return (count - 1) * NS_PER_S / span_ns if span_ns else 0.0


def _class_of(detection: Any) -> str:
    return str(detection.results[0].hypothesis.class_id) if detection.results else "unknown"


def describe(path: Path) -> BagDescription:
    """Reads the whole bag once for its messages and once for its checksums."""
    reader = BagReader(resolve_bag(path), debug=True)
    files = mcap_files(reader.path)
    checksums = sum((validate_checksums(file) for file in files), ChecksumCoverage())
    tally = _TopicTally(frozenset(lidar_topics(reader)), _truth(reader))
    for raw in reader.raw_messages():
        tally.add(reader, raw)
    together = tally.lidar("")
    start_ns = min(tally.first_ns.values(), default=0)
    return BagDescription(
        path=str(reader.path),
        files=tuple(file.name for file in files),
        bytes=sum(file.stat().st_size for file in files),
        start_ns=start_ns,
        duration_s=(max(tally.last_ns.values(), default=0) - start_ns) / NS_PER_S,
        messages=sum(info.count for info in reader.topics.values()),
        topics=tuple(
            TopicDescription(
                name, info.type, info.count, tally.rate_hz(name, info.count), _qos_text(info.qos)
            )
            for name, info in sorted(reader.topics.items())
        ),
        clouds=together.clouds,
        points_least=together.points_least,
        points_mean=together.points_mean,
        points_most=together.points_most,
        lidars=tuple(map(tally.lidar, sorted(tally.points))),
        objects=tuple(
            ObjectCount(name, boxes, len(tally.ids[name])) for name, boxes in sorted(tally.boxes.items())
        ),
        uncounted=UncountedLabels(dict(sorted(tally.ignored.items())), tally.regions, tally.partial),
        v2x=read_statistics(reader),
        provenance=dict(reader.provenance),
        checksums=checksums,
    )


def _truth(reader: BagReader) -> frozenset[str]:
    """The vehicles' ground truth; in another tool's bag, all boxes; not what CAMs reported."""
    names = reader.topics_of_type(_OBJECTS_TYPE)
    own = [name for name in names if name == VehicleTopics(name.strip("/").split("/")[0]).objects.name]
    return frozenset(own or names)


def _qos_text(profiles: tuple[Qos, ...]) -> str:
    """Such as `reliable 10`, or `reliable latched 1` for transient local durability."""
    texts = []
    for qos in profiles:
        latched = " latched" if qos.durability is QosDurability.TRANSIENT_LOCAL else ""
        texts.append(f"{qos.reliability.name.lower()}{latched} {qos.depth}")
    return ", ".join(dict.fromkeys(texts))
