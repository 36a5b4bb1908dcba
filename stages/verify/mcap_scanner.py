"""Scan one .mcap file from its first to its last byte: every record is read, with no gaps between them."""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
)
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.mcap.reader import DAMAGE
from advpipe.pipeline.mcap.records import (
    HEAD,
    Record,
    inner_records,
    parse_chunk,
    parse_message,
    parse_message_index,
    parse_record,
    read_records,
)
from advpipe.pipeline.mcap.ros2_topic import ros2_topic
from advpipe.pipeline.mcap.unpacking import UnpackBudget
from advpipe.stages.verify.summary_check import check_summary

FIRST_PRIVATE_OPCODE = 0x80

DEFINITIONS_LIMIT_BYTES = 1 << 24
"""The limit on all definitions of types and channels together, since they may be in compressed chunks."""


@dataclass
class McapScanner:
    """The actual contents of a file, filled by `messages`; faults: everything wrong with its structure.

    counts: messages by channel. first_ns, last_ns: log times, None without messages.
    """

    path: Path
    faults: list[str] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    topics: dict[int, Topic] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    records: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    _offsets: dict[int, array[int]] = field(default_factory=dict)
    _texts: dict[int, str] = field(default_factory=dict)
    _undefined: set[int] = field(default_factory=set)
    _definitions_bytes: int = 0

    def messages(self) -> Iterator[RawMessage]:
        """All messages in the order of the file; a damaged chunk is skipped and becomes a fault."""
        try:
            yield from self._messages()
        except OSError as error:
            self.faults.append(f"cannot be read: {error.strerror or error}")
        except DAMAGE as error:
            self.faults.append(f"damaged or truncated: {error}" if str(error) else "damaged or truncated")
        except AdvpipeError as error:  # channels that are not ROS 2 channels
            self.faults.append(str(error))

    def _messages(self) -> Iterator[RawMessage]:
        size = self.path.stat().st_size
        self._budget = UnpackBudget(size)
        end, crc = size - len(MCAP0_MAGIC), zlib.crc32(MCAP0_MAGIC)
        with self.path.open("rb") as stream:
            if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise ValueError("wrong magic bytes at the start")
            stream.seek(max(end, 0))
            if stream.read() != MCAP0_MAGIC or end < len(MCAP0_MAGIC):
                raise ValueError("the end is missing")
            for record in read_records(stream, len(MCAP0_MAGIC), end):
                if record.opcode == Opcode.DATA_END:
                    self._end_chunk(record.start)
                    parsed = parse_record(record.opcode, record.body)
                    if isinstance(parsed, DataEnd) and parsed.data_section_crc not in (0, crc):
                        self.faults.append("the checksum of the data section is wrong")
                    self.check_bytes(record, parsed)
                    check_summary(self, read_records(stream, record.end, end), record.end)
                    return
                crc = zlib.crc32(record.body, zlib.crc32(HEAD.pack(record.opcode, len(record.body)), crc))
                yield from self._record(record)
        raise ValueError("the data section has no end record")

    def _record(self, record: Record) -> Iterator[RawMessage]:
        if record.start == len(MCAP0_MAGIC) and record.opcode != Opcode.HEADER:
            self.faults.append("the header is missing")
        if record.opcode == Opcode.MESSAGE_INDEX:
            self._message_index(record)
            return
        self._end_chunk(record.start)
        if record.opcode == Opcode.CHUNK:
            yield from self._chunk(record)
        elif record.opcode == Opcode.MESSAGE:
            yield from self._message(memoryview(record.body))
        else:
            parsed = parse_record(record.opcode, record.body)
            self.check_bytes(record, parsed)
            self._define(record, parsed)

    def _define(self, record: Record, parsed: McapRecord | None) -> None:
        if isinstance(parsed, Header):
            if parsed.profile != "ros2":
                self.faults.append(f"the profile is {parsed.profile!r}, not ros2")
        elif isinstance(parsed, (Schema, Channel)):
            self._add_definition(parsed)
        elif isinstance(parsed, Metadata):
            if parsed.name in self.records:
                self.faults.append(f"there are two metadata records {parsed.name!r}")
            self.records[parsed.name] = parsed.metadata
            self.metadata.append(MetadataIndex(record.start, record.end - record.start, parsed.name))
        elif isinstance(parsed, Attachment):
            self.attachments += 1
        elif parsed is not None or record.opcode < FIRST_PRIVATE_OPCODE:
            self.faults.append(
                f"a record with opcode {record.opcode:#04x} at {record.start} does not belong in the "
                "data section"
            )

    def _add_definition(self, definition: Schema | Channel) -> None:
        """Add a schema or a channel; repeated definitions must be equal."""
        if definition.id not in (self.schemas if isinstance(definition, Schema) else self.channels):
            self._definitions_bytes += len(_bytes_of(definition))
            if self._definitions_bytes > DEFINITIONS_LIMIT_BYTES:
                raise ValueError(f"type and channel definitions exceed {DEFINITIONS_LIMIT_BYTES} bytes")
        if isinstance(definition, Schema):
            if self.schemas.setdefault(definition.id, definition) != definition:
                self.faults.append(f"schema {definition.id} is defined in two ways")
            return
        if self.channels.setdefault(definition.id, definition) != definition:
            self.faults.append(f"channel {definition.id} is defined in two ways")
        elif definition.id not in self.topics:
            schema = self.schemas.get(definition.schema_id)
            if schema is None:
                raise ValueError(f"{definition.topic} refers to a schema that is not defined")
            self.topics[definition.id] = ros2_topic(self.path, definition, schema)
            self._texts[definition.id] = schema.data.decode()

    def _chunk(self, record: Record) -> Iterator[RawMessage]:
        try:
            chunk = parse_chunk(record.body)
            data = self._budget.unpack(chunk)
        except DAMAGE as error:
            self.faults.append(f"the chunk at {record.start} is damaged: {error}")
            return
        self._offsets = {}
        for opcode, offset, body in inner_records(data):
            if opcode == Opcode.MESSAGE:
                for raw in self._message(body):
                    offsets = self._offsets.setdefault(parse_message(body).channel_id, array("Q"))
                    offsets.extend((raw.log_time_ns, offset))
                    yield raw
            else:
                parsed = parse_record(opcode, body)
                if not isinstance(parsed, (Schema, Channel)) or _bytes_of(parsed)[HEAD.size :] != body:
                    raise ValueError(
                        f"the chunk at {record.start} holds a record that does not belong in a chunk"
                    )
                self._add_definition(parsed)
        times_ns = [offsets[::2] for offsets in self._offsets.values()]
        span_ns = (min(map(min, times_ns)), max(map(max, times_ns))) if times_ns else (0, 0)
        if (chunk.message_start_time, chunk.message_end_time) != span_ns:
            self.faults.append(f"the chunk at {record.start} states times that differ from its messages'")
        self.chunks.append(
            ChunkIndex(
                chunk_length=record.end - record.start,
                chunk_start_offset=record.start,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=0,
                message_index_offsets={},
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _message(self, body: memoryview) -> Iterator[RawMessage]:
        message = parse_message(body)
        self._budget.count_messages(1)
        if message.channel_id not in self.topics:
            if message.channel_id not in self._undefined:
                self.faults.append(f"a message belongs to channel {message.channel_id}, which is not defined")
            self._undefined.add(message.channel_id)
            return
        schema = self.schemas[self.channels[message.channel_id].schema_id]
        time_ns = message.log_time_ns
        self.counts[message.channel_id] = self.counts.get(message.channel_id, 0) + 1
        self.first_ns = time_ns if self.first_ns is None else min(self.first_ns, time_ns)
        self.last_ns = time_ns if self.last_ns is None else max(self.last_ns, time_ns)
        yield RawMessage(
            self.topics[message.channel_id],
            self._texts[message.channel_id],
            bytes(message.data),
            time_ns,
            message.publish_time_ns,
            message.sequence,
            schema.encoding,
        )

    def _message_index(self, record: Record) -> None:
        channel_id, entries = parse_message_index(record.body)
        if not self.chunks or not len(entries):
            if not self.chunks:
                self.faults.append(f"the message index at {record.start} follows no chunk")
            return
        real = self._offsets.pop(channel_id, array("Q"))
        if not np.array_equal(_sorted(entries), _sorted(np.frombuffer(real, np.uint64).reshape(-1, 2))):
            self.faults.append(f"the message index at {record.start} does not match its chunk")
        chunk = self.chunks[-1]
        chunk.message_index_offsets[channel_id] = record.start
        chunk.message_index_length += record.end - record.start

    def _end_chunk(self, place: int) -> None:
        """Finish the indexes of the last chunk, at the start of another record."""
        if self._offsets and self.chunks and self.chunks[-1].message_index_offsets:
            self.faults.append(f"a message index is missing before {place}")
        self._offsets = {}

    def check_bytes(self, record: Record, parsed: McapRecord | None) -> None:
        """Compare a record with its canonical encoding, so that no bit of it can change unnoticed."""
        if parsed is None or (isinstance(parsed, Attachment) and record.body[-4:] == bytes(4)):
            return
        if _bytes_of(parsed) != record.bytes:
            self.faults.append(f"the record at {record.start} holds bytes that are not part of its fields")


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _sorted(entries: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    return entries[np.lexsort((entries[:, 1], entries[:, 0]))]
