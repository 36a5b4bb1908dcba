"""The bag that somebody plays into the graph, with which a relay's recording is completed."""

from __future__ import annotations

import heapq
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.labels import clouds, fixes
from advpipe.pipeline.labels.messages import FILE as MESSAGE_LABELS
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.cdr import stamp_of_header
from advpipe.pipeline.messages.topics import V2X_PACKETS, V2X_SENT, V2X_STATISTICS, VehicleTopics

_INHERITED = ("scenario_name", "scenario", "source", "map_sha256")
CLOUDS, FIXES = "clouds", "fixes"
_TABLES = {
    clouds.POINTS: ("frame", CLOUDS),
    clouds.FRAMES: ("frame", CLOUDS),
    fixes.FILE: ("fix", FIXES),
}
"""Tables beside a bag, with the column that counts messages, and of what."""

Moments = dict[int, tuple[int, int]]
"""Log time and number of a message by its stamp."""

_UNKNOWN = (0, -1)
RESOLVED = "relay.yaml"
"""Beside the bag: what was relayed, with all defaults."""


class PlayedBag:
    """A clean bag. Raises UsageError for an adversarial one."""

    def __init__(self, path: Path) -> None:
        self._reader = BagReader(resolve_bag(path))
        if self._reader.provenance.is_attack:
            raise UsageError(f"{path} is an adversarial bag; name the clean bag that is played")

    def complete(
        self,
        recorded: Path,
        stamped: Mapping[str, str],
        replaced: Sequence[str],
        finish: Callable[[Path], None],
    ) -> None:
        """Add this bag's other topics to a relay's recording, which then is an adversarial bag of this one.

        stamped: topics whose messages have the log times and numbers that those of the same stamps have here;
        by `CLOUDS` or `FIXES`. replaced: further topics that come from the recording alone. finish: as
        `BagWriter` takes it. Raises AdvpipeError for a recorded message that this bag lacks; the recording
        stays as it is then.
        """
        reader = BagReader(recorded, debug=True)
        moments = {family: self._moments(name) for family, name in stamped.items() if name in reader.topics}
        by_topic = {stamped[family]: each for family, each in moments.items()}
        mine = self._reader.topics.keys() - {*reader.topics, *stamped.values(), *replaced}
        about = self._reader.provenance
        provenance = {
            **{key: about[key] for key in _INHERITED if key in about},
            **reader.provenance,
            "parent_sha256": parent_sha256(self._reader.path),
        }
        streams = [self._messages(reader, name, by_topic.get(name)) for name in sorted(reader.topics)]
        if mine:
            streams.append(self._reader.raw_messages(mine))
        with BagWriter(recorded, provenance=provenance, overwrite=True, finish=finish) as bag:
            for path in sorted(recorded.iterdir()):
                if path.name in _TABLES:
                    column, family = _TABLES[path.name]
                    _copy_numbered(path, bag.folder / path.name, column, moments.get(family, {}))
                elif path.name in (MESSAGE_LABELS, RESOLVED):
                    shutil.copyfile(path, bag.folder / path.name)
            for raw in heapq.merge(*streams, key=lambda raw: raw.log_time_ns):
                bag.copy(raw)

    def _moments(self, topic: str) -> Moments:
        """The log time and the number of each message of a topic, by its stamp."""
        found: dict[int, tuple[int, int]] = {}
        for number, raw in enumerate(self._reader.raw_messages([topic])):
            found.setdefault(stamp_of_header(raw.cdr), (raw.log_time_ns, number))
        return found

    def _messages(self, reader: BagReader, topic: str, moments: Moments | None) -> Iterator[RawMessage]:
        for raw in reader.raw_messages([topic]):
            if moments is None:
                yield raw
                continue
            if (moment := moments.get(stamp_ns := stamp_of_header(raw.cdr))) is None:
                raise AdvpipeError(
                    f"{self._reader.path} lacks a message of {stamp_ns} ns on {topic} that was relayed: "
                    f"another bag was played; {reader.path} stays without its other topics"
                )
            yield replace(raw, log_time_ns=moment[0], publish_time_ns=moment[0])


def _copy_numbered(source: Path, target: Path, column: str, moments: Moments) -> None:
    """A table with messages counted as in the clean bag."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with pq.ParquetFile(str(source)) as table:
        schema = table.schema_arrow
        place = schema.get_field_index(column)
        with pq.ParquetWriter(str(target), schema) as writer:
            for group in range(table.num_row_groups):
                rows = table.read_row_group(group)
                stamps_ns = rows["stamp_ns"].to_pylist()
                numbers = pa.array([moments.get(stamp_ns, _UNKNOWN)[1] for stamp_ns in stamps_ns], pa.int32())
                writer.write_table(rows.set_column(place, schema.field(place), numbers))


def topics_of_v2x(vehicle: str) -> tuple[str, ...]:
    """What a clean bag holds of messages that an attack makes untrue."""
    own = VehicleTopics(vehicle)
    topics = (
        *(own.received_raw, own.received_cam, own.reception_info, own.true_receptions, own.ldm),
        *(own.ldm_objects, own.rejections, V2X_SENT, V2X_PACKETS, V2X_STATISTICS),
    )
    return tuple(topic.name for topic in topics)
