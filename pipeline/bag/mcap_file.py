"""One .mcap file: checked when opened, its errors said in one line."""

from __future__ import annotations

import heapq
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import zstandard
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, MessageIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.bag.topics import RawMessage, Topic, qos_from_yaml
from advpipe.pipeline.errors import AdvpipeError

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, summary offset start, summary CRC
_qos = lru_cache(256)(qos_from_yaml)
_SCHEMA_ENCODINGS = ("ros2msg", "ros2idl")
DAMAGE = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,  # also failed checksums and bytes that are no UTF-8
    LookupError,
    EOFError,
    RuntimeError,
    MemoryError,
    OverflowError,
    StopIteration,
)
"""What the libraries raise on bytes that are not what was written."""


@contextmanager
def mcap_errors(path: Path) -> Iterator[None]:
    """Turn what damaged bytes and failing disks raise into one line."""
    try:
        yield
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except DAMAGE as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise AdvpipeError(f"{path}: damaged or cut off ({reason})") from None


class McapFile:
    """A .mcap file of a ROS 2 recording, with or without an index.

    topics: by channel id. counts: messages by topic name. metadata: records by name.

    Chunk and summary checksums are validated where the file has them. Raises AdvpipeError for anything
    that is no whole MCAP file of CDR messages.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with mcap_errors(path):
            check_ends(path)
            with path.open("rb") as stream:
                reader = make_reader(stream, validate_crcs=True)
                summary = reader.get_summary()
                self.metadata = {record.name: record.metadata for record in reader.iter_metadata()}
            if summary is not None and {index.name for index in summary.metadata_indexes} != set(
                self.metadata
            ):
                raise AdvpipeError(f"{path}: damaged (a metadata record has another name than its index)")
            self.is_indexed = summary is not None and _is_indexed(summary)
            self._summary = summary if summary is not None and self.is_indexed else self._scan()
            self.topics = {
                channel.id: ros2_topic(path, channel, self._summary.schemas[channel.schema_id])
                for channel in self._summary.channels.values()
            }
            self.counts = self._counts()

    def log_times_ns(self, topic_name: str) -> npt.NDArray[np.int64]:
        """Log times (K,) of a topic's messages, ascending; read from the index, no chunk is unpacked."""
        with mcap_errors(self.path):
            times = self._indexed_times(topic_name) if self.is_indexed else self._read_times(topic_name)
            if len(times) != self.counts.get(topic_name, 0):
                raise ValueError(f"the index has {len(times)} messages of {topic_name}")
            return np.sort(np.array(times, dtype=np.int64))

    def raw_messages(
        self,
        topic_names: Collection[str] | None = None,
        first_ns: int | None = None,
        last_ns: int | None = None,
    ) -> Iterator[RawMessage]:
        """Messages in log-time order, `first_ns` and `last_ns` included; only their chunks are unpacked."""
        with mcap_errors(self.path), self.path.open("rb") as stream:
            if self.is_indexed:
                reader = make_reader(stream, validate_crcs=True)
                messages = reader.iter_messages(topic_names, starting_at=first_ns, ending_at=last_ns)
            else:
                reader = NonSeekingReader(stream, validate_crcs=True)
                messages = reader.iter_messages(
                    topic_names, log_time_order=False, starting_at=first_ns, ending_at=last_ns
                )
            newest_ns = 0
            for schema, channel, message in messages:
                if message.log_time < newest_ns:
                    raise ValueError("without an index, messages must lie in time order")
                newest_ns = message.log_time
                yield RawMessage(
                    topic=self.topics[channel.id],
                    schema=schema.data.decode() if schema else "",
                    cdr=message.data,
                    log_time_ns=message.log_time,
                    publish_time_ns=message.publish_time,
                    sequence=message.sequence,
                    schema_encoding=schema.encoding if schema else "",
                )

    def _read_times(self, topic_name: str) -> list[int]:
        return [raw.log_time_ns for raw in self.raw_messages([topic_name])]

    def _indexed_times(self, topic_name: str) -> list[int]:
        ids = [channel_id for channel_id, topic in self.topics.items() if topic.name == topic_name]
        times_ns: list[int] = []
        with self.path.open("rb") as stream:
            for chunk in self._summary.chunk_indexes:
                offsets = chunk.message_index_offsets
                for channel_id in (i for i in ids if i in offsets):
                    stream.seek(offsets[channel_id])
                    record = next(StreamReader(stream, skip_magic=True).records)
                    if not isinstance(record, MessageIndex):
                        raise ValueError("a message index is missing")
                    times_ns += [log_time_ns for log_time_ns, _ in record.records]
        return times_ns

    def _scan(self) -> Summary:
        """A summary of a file that has none, by reading all of it."""
        summary, counts = Summary(), dict[int, int]()
        with self.path.open("rb") as stream:
            reader = NonSeekingReader(stream, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                if schema is not None:
                    summary.schemas[schema.id] = schema
                summary.channels[channel.id] = channel
                counts[channel.id] = counts.get(channel.id, 0) + 1
                del message
        summary.statistics = Statistics(0, len(counts), counts, 0, 0, sum(counts.values()), 0, 0, 0)
        return summary

    def _counts(self) -> dict[str, int]:
        """Messages by topic name."""
        statistics = self._summary.statistics
        counts = dict.fromkeys((topic.name for topic in self.topics.values()), 0)
        for channel_id, count in (statistics.channel_message_counts if statistics else {}).items():
            counts[self.topics[channel_id].name] += count
        return counts


def check_ends(path: Path) -> None:
    """Whole at both ends, and a summary that its checksum covers is as it was written."""
    size = path.stat().st_size
    magic_bytes = len(MCAP0_MAGIC)
    with path.open("rb") as stream:
        if size == 0:
            raise AdvpipeError(f"{path} is empty, no MCAP file")
        if stream.read(magic_bytes) != MCAP0_MAGIC:
            raise AdvpipeError(f"{path} is no MCAP file (wrong first bytes)")
        if size < 2 * magic_bytes + _FOOTER.size:
            raise AdvpipeError(f"{path} is cut off: {size} bytes are too few for an MCAP file")
        stream.seek(-(_FOOTER.size + magic_bytes), 2)
        footer = stream.read(_FOOTER.size)
        if stream.read() != MCAP0_MAGIC:
            raise AdvpipeError(
                f"{path} is cut off: the end of the MCAP file is missing; `advpipe recover` saves the rest"
            )
        _, _, summary_start, _, summary_crc = _FOOTER.unpack(footer)
        if not summary_crc or not summary_start:
            return
        stream.seek(summary_start)
        length = size - magic_bytes - 4 - summary_start
        if length < 0 or zlib.crc32(stream.read(length)) != summary_crc:
            raise AdvpipeError(f"{path}: damaged (summary checksum)")


def ros2_topic(path: Path, channel: Channel, schema: Schema) -> Topic:
    """What a channel says; AdvpipeError where it is none of a ROS 2 recording."""
    if channel.message_encoding != "cdr":
        raise AdvpipeError(
            f"{path}: {channel.topic} is encoded as {channel.message_encoding!r}; "
            "advpipe reads ROS 2 bags, where all topics are 'cdr'"
        )
    if schema.encoding not in _SCHEMA_ENCODINGS:
        raise AdvpipeError(f"{path}: {channel.topic} has a schema in {schema.encoding!r}, not ROS 2's")
    return Topic(
        name=channel.topic,
        type=schema.name,
        qos=_qos(channel.metadata.get("offered_qos_profiles", "")),
        type_hash=channel.metadata.get("topic_type_hash", ""),
    )


def _is_indexed(summary: Summary) -> bool:
    """Whether time ranges can be looked up: statistics, channels and message indexes are all there."""
    statistics = summary.statistics
    return (
        statistics is not None
        and len(summary.channels) == statistics.channel_count
        and len(summary.chunk_indexes) == statistics.chunk_count
        and (statistics.chunk_count > 0 or statistics.message_count == 0)
        and all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
    )


def in_time_order(streams: list[Iterator[RawMessage]]) -> Iterator[RawMessage]:
    """Several files' messages as one stream; at equal times, the earlier file's first."""
    return heapq.merge(*streams, key=lambda raw: raw.log_time_ns)
