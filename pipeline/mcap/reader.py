"""Reads one .mcap file: it is checked when opened, and its errors are one line."""

from __future__ import annotations

import heapq
import struct
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt
import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex, Statistics
from mcap.summary import Summary

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.ends import check_ends
from advpipe.pipeline.mcap.recent_chunks import LARGEST_BYTES, RECENT_CHUNKS, UnpackedChunk
from advpipe.pipeline.mcap.records import (
    InnerMessage,
    inner_records,
    parse_chunk,
    parse_message,
    parse_message_index,
    parse_record,
    read_records,
)
from advpipe.pipeline.mcap.ros2_topic import ros2_topic
from advpipe.pipeline.mcap.summary import add_definition, data_records, read_metadata, read_summary
from advpipe.pipeline.mcap.unpacking import MESSAGE_BYTES, UnpackBudget

LATEST_NS = 2**64 - 1
"""The last log time that a file can hold."""

WAITING_LIMIT_BYTES = 1 << 30
"""Most bytes of messages that are held back because chunks overlap in time."""

DAMAGE = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,  # also failed checksums and invalid UTF-8
    LookupError,
    EOFError,
    RuntimeError,
    MemoryError,
    OverflowError,
    StopIteration,
)
"""The exceptions that the libraries raise on damaged bytes."""


def log_time(time_ns: int) -> np.uint64:
    """The time in ns, or the nearest that a file can hold."""
    return np.uint64(min(max(time_ns, 0), LATEST_NS))


@contextmanager
def mcap_errors(path: Path) -> Iterator[None]:
    """Raise AdvpipeError, one line, for the exceptions of damaged bytes and failing disks in the block."""
    try:
        yield
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except DAMAGE as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise AdvpipeError(f"{path}: damaged or truncated ({reason})") from None


class McapFile:
    """A .mcap file of a ROS 2 recording, with or without an index.

    topics: by channel id. counts: messages by topic name. metadata: records by name.

    Chunk and summary checksums are validated where the file has them. Raises AdvpipeError for a file that is
    not a complete MCAP file of CDR messages.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._key = path, object()
        with mcap_errors(path):
            check_ends(path)
            with path.open("rb") as stream:
                summary = read_summary(stream)
                self.metadata = read_metadata(stream, summary)
            if summary is not None and {index.name for index in summary.metadata_indexes} != set(
                self.metadata
            ):
                raise AdvpipeError(f"{path}: damaged (a metadata record and its index have different names)")
            self.is_indexed = summary is not None and _is_indexed(summary)
            self._summary = summary if summary is not None and self.is_indexed else self._scan()
            self.topics = {
                channel.id: ros2_topic(path, channel, self._summary.schemas[channel.schema_id])
                for channel in self._summary.channels.values()
            }
            self._schema_of = {
                channel.id: (schema.data.decode(), schema.encoding)
                for channel in self._summary.channels.values()
                for schema in [self._summary.schemas[channel.schema_id]]
            }
            self.counts = self._counts()

    @cached_property
    def span_ns(self) -> tuple[int, int]:
        """The first and the last log time, as the index says; all times, where a file has none.

        Without messages, a span that no time is in.
        """
        if not self.is_indexed:
            return 0, LATEST_NS
        starts_ns, ends_ns = self._chunk_times_ns
        return (int(starts_ns.min()), int(ends_ns.max())) if len(starts_ns) else (LATEST_NS, 0)

    def log_times_ns(self, topic_name: str) -> npt.NDArray[np.int64]:
        """Log times (K,) int64 of a topic's messages in ns, ascending.

        With an index, no chunk is decompressed. Raises AdvpipeError for a damaged file.
        """
        with mcap_errors(self.path):
            times = self._indexed_times(topic_name) if self.is_indexed else self._read_times(topic_name)
            if len(times) != self.counts.get(topic_name, 0):
                raise ValueError(
                    f"the index lists {len(times)} messages of {topic_name}, the statistics "
                    f"{self.counts.get(topic_name, 0)}"
                )
            return np.sort(times)

    def raw_messages(
        self,
        topic_names: Collection[str] | None = None,
        first_ns: int | None = None,
        last_ns: int | None = None,
    ) -> Iterator[RawMessage]:
        """Yield messages in log-time order, from `first_ns` to `last_ns` inclusive.

        topic_names: all topics by default. With an index, only the chunks of these messages are decompressed,
        and a file that has none stays closed. Raises AdvpipeError for a damaged file.
        """
        names = set(self.counts if topic_names is None else topic_names)
        ids = {channel_id for channel_id, topic in self.topics.items() if topic.name in names}
        first_ns, last_ns = first_ns or 0, LATEST_NS if last_ns is None else last_ns
        chunks = self._chunks_within(ids, first_ns, last_ns) if self.is_indexed else None
        if chunks == []:
            return
        with mcap_errors(self.path), self.path.open("rb") as stream:
            if chunks is None:
                yield from self._in_file_order(stream, ids, first_ns, last_ns)
            else:
                yield from self._in_time_order(stream, chunks, ids, first_ns, last_ns)

    def _in_time_order(
        self, stream: IO[bytes], chunks: list[ChunkIndex], ids: set[int], first_ns: int, last_ns: int
    ) -> Iterator[RawMessage]:
        """Decompress each chunk when its first message is due; until then, a heap holds its index entry."""
        waiting: list[tuple[int, int, int, ChunkIndex | RawMessage]] = [
            (chunk.message_start_time, chunk.chunk_start_offset, -1, chunk) for chunk in chunks
        ]
        heapq.heapify(waiting)
        held_bytes, budget = 0, self._budget()
        while waiting:
            _, chunk_start, _, item = heapq.heappop(waiting)
            if isinstance(item, RawMessage):
                held_bytes -= len(item.cdr) + MESSAGE_BYTES
                yield item
                continue
            for offset, raw in self._messages_of(stream, item, budget, ids, first_ns, last_ns):
                heapq.heappush(waiting, (raw.log_time_ns, chunk_start, offset, raw))
                held_bytes += len(raw.cdr) + MESSAGE_BYTES
                if held_bytes > WAITING_LIMIT_BYTES:
                    raise ValueError(f"more than {WAITING_LIMIT_BYTES} bytes of messages are out of order")

    def _messages_of(
        self,
        stream: IO[bytes],
        index: ChunkIndex,
        budget: UnpackBudget,
        ids: set[int],
        first_ns: int,
        last_ns: int,
    ) -> Iterator[tuple[int, RawMessage]]:
        """The messages of a chunk with their offsets in it; a chunk that was read shortly before is not
        unpacked again."""
        start = index.chunk_start_offset
        chunk = RECENT_CHUNKS.find(self._key, start)
        if chunk is None:
            record = next(read_records(stream, start, start + index.chunk_length))
            if record.opcode != Opcode.CHUNK:
                raise ValueError(f"a chunk index points at byte {start}, where there is no chunk")
            packed = parse_chunk(record.body)
            if packed.uncompressed_size > LARGEST_BYTES:
                yield from self._messages_in(packed, budget, ids, first_ns, last_ns)
                return
            chunk = UnpackedChunk.of(budget.unpack(packed))
            self._refuse_undefined(chunk.by_channel)
            RECENT_CHUNKS.keep(self._key, start, chunk)
        budget.count_messages(chunk.count)
        for offset, message in chunk.messages(ids):
            if first_ns <= message.log_time_ns <= last_ns:
                yield offset, self._raw(message)

    def _chunks_within(self, ids: set[int], first_ns: int, last_ns: int) -> list[ChunkIndex]:
        """The chunks with messages of these channels that touch this span; in a recording of an hour, one of
        tens of thousands."""
        starts_ns, ends_ns = self._chunk_times_ns
        is_within = (ends_ns >= log_time(first_ns)) & (starts_ns <= log_time(last_ns))
        chunks = (self._summary.chunk_indexes[place] for place in np.flatnonzero(is_within))
        return [chunk for chunk in chunks if not ids.isdisjoint(chunk.message_index_offsets)]

    @cached_property
    def _chunk_times_ns(self) -> npt.NDArray[np.uint64]:
        """The first and the last log time of each chunk (2, C)."""
        chunks = self._summary.chunk_indexes
        times_ns = [(chunk.message_start_time, chunk.message_end_time) for chunk in chunks]
        return np.array(times_ns, np.uint64).reshape(-1, 2).T

    def _in_file_order(
        self, stream: IO[bytes], ids: set[int], first_ns: int, last_ns: int
    ) -> Iterator[RawMessage]:
        newest_ns, budget = 0, self._budget()
        for record in data_records(stream):
            if record.opcode == Opcode.CHUNK:
                inside = self._messages_in(parse_chunk(record.body), budget, ids, first_ns, last_ns)
            elif record.opcode == Opcode.MESSAGE:
                inside = self._selected(0, memoryview(record.body), ids, first_ns, last_ns)
            else:
                continue
            for _, raw in inside:
                if raw.log_time_ns < newest_ns:
                    raise ValueError("in a file without an index, messages must be in time order")
                newest_ns = raw.log_time_ns
                yield raw

    def _messages_in(
        self, chunk: Chunk, budget: UnpackBudget, ids: set[int], first_ns: int, last_ns: int
    ) -> Iterator[tuple[int, RawMessage]]:
        for opcode, offset, body in inner_records(budget.unpack(chunk)):
            if opcode == Opcode.MESSAGE:
                budget.count_messages(1)
                yield from self._selected(offset, body, ids, first_ns, last_ns)

    def _selected(
        self, offset: int, body: memoryview, ids: set[int], first_ns: int, last_ns: int
    ) -> Iterator[tuple[int, RawMessage]]:
        message = parse_message(body)
        self._refuse_undefined((message.channel_id,))
        if message.channel_id in ids and first_ns <= message.log_time_ns <= last_ns:
            yield offset, self._raw(message)

    def _refuse_undefined(self, channel_ids: Iterable[int]) -> None:
        for channel_id in channel_ids:
            if channel_id not in self.topics:
                raise ValueError(f"a message belongs to channel {channel_id}, which is not defined")

    def _raw(self, message: InnerMessage) -> RawMessage:
        text, encoding = self._schema_of[message.channel_id]
        return RawMessage(
            topic=self.topics[message.channel_id],
            schema=text,
            cdr=bytes(message.data),
            log_time_ns=message.log_time_ns,
            publish_time_ns=message.publish_time_ns,
            sequence=message.sequence,
            schema_encoding=encoding,
        )

    def _read_times(self, topic_name: str) -> npt.NDArray[np.int64]:
        times_ns = (raw.log_time_ns for raw in self.raw_messages([topic_name]))
        return np.fromiter(times_ns, np.int64)

    def _indexed_times(self, topic_name: str) -> npt.NDArray[np.int64]:
        ids = [channel_id for channel_id, topic in self.topics.items() if topic.name == topic_name]
        times_ns = [np.zeros(0, np.int64)]
        end = self.path.stat().st_size
        with self.path.open("rb") as stream:
            for chunk in self._summary.chunk_indexes:
                offsets = chunk.message_index_offsets
                for channel_id in (i for i in ids if i in offsets):
                    record = next(read_records(stream, offsets[channel_id], end), None)
                    if record is None or record.opcode != Opcode.MESSAGE_INDEX:
                        raise ValueError("a message index is missing")
                    times_ns.append(parse_message_index(record.body)[1][:, 0].astype(np.int64))
        return np.concatenate(times_ns)

    def _scan(self) -> Summary:
        """Make the summary of a file that has none by reading the whole file."""
        summary, counts, budget = Summary(), dict[int, int](), self._budget()
        with self.path.open("rb") as stream:
            for record in data_records(stream):
                inside: Iterable[tuple[int, int, memoryview]] = [(record.opcode, 0, memoryview(record.body))]
                if record.opcode == Opcode.CHUNK:
                    inside = inner_records(budget.unpack(parse_chunk(record.body)))
                for opcode, _, body in inside:
                    if opcode == Opcode.MESSAGE:
                        budget.count_messages(1)
                        channel_id = parse_message(body).channel_id
                        counts[channel_id] = counts.get(channel_id, 0) + 1
                    elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                        add_definition(summary, parse_record(opcode, body))
        summary.channels = {key: one for key, one in summary.channels.items() if key in counts}
        summary.statistics = Statistics(0, len(counts), counts, 0, 0, sum(counts.values()), 0, 0, 0)
        return summary

    def _budget(self) -> UnpackBudget:
        return UnpackBudget(self.path.stat().st_size)

    def _counts(self) -> dict[str, int]:
        """Messages by topic name."""
        statistics = self._summary.statistics
        counts = dict.fromkeys((topic.name for topic in self.topics.values()), 0)
        for channel_id, count in (statistics.channel_message_counts if statistics else {}).items():
            counts[self.topics[channel_id].name] += count
        return counts


def _is_indexed(summary: Summary) -> bool:
    """Whether time ranges can be looked up: statistics, channels and message indexes are complete."""
    statistics = summary.statistics
    return (
        statistics is not None
        and len(summary.channels) == statistics.channel_count
        and len(summary.chunk_indexes) == statistics.chunk_count
        and (statistics.chunk_count > 0 or statistics.message_count == 0)
        and all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
    )
