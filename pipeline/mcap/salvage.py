"""Reads the intact part of a damaged or truncated .mcap file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.mcap.ends import check_ends
from advpipe.pipeline.mcap.reader import DAMAGE
from advpipe.pipeline.mcap.records import (
    Record,
    inner_records,
    parse_chunk,
    parse_message,
    parse_message_index,
    parse_record,
    read_records,
)
from advpipe.pipeline.mcap.ros2_topic import ros2_topic
from advpipe.pipeline.mcap.summary import read_summary
from advpipe.pipeline.mcap.unpacking import UnpackBudget


@dataclass
class Salvage:
    """The intact messages of one file, and counts of what is lost, which grow while messages are read.

    A chunk is recovered only as a whole, with a valid checksum. lost_messages: the messages of damaged chunks
    that an index still counts; those in a missing end are unknown. lost_bytes: bytes of the file in damaged
    chunks and in incomplete records. metadata: records by name.
    """

    path: Path
    lost_chunks: int = 0
    lost_messages: int = 0
    lost_bytes: int = 0
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _topics: dict[int, tuple[Topic, Schema]] = field(default_factory=dict)

    def messages(self) -> Iterator[RawMessage]:
        """Yield the messages in the file's order. Raises AdvpipeError for a file that is not a ROS 2 bag."""
        with self.path.open("rb") as stream:
            self._check_start(stream)
            summary = self._summary(stream)
            for definition in (*summary.schemas.values(), *summary.channels.values()):
                self._define(definition)
            chunk_starts = [index.chunk_start_offset for index in summary.chunk_indexes]
            is_damaged, budget = False, UnpackBudget(self.path.stat().st_size)
            for record in self._records(stream, chunk_starts):
                if record.opcode == Opcode.MESSAGE_INDEX:
                    self.lost_messages += _entries(record.body) if is_damaged else 0
                elif record.opcode == Opcode.CHUNK:
                    inside = _decompressed_records(record.body, budget)
                    is_damaged = inside is None
                    self.lost_chunks += is_damaged
                    self.lost_bytes += _compressed_bytes(record.body) if is_damaged else 0
                    yield from self._read(inside or [])
                else:
                    yield from self._read([(record.opcode, memoryview(record.body))])

    def _check_start(self, stream: IO[bytes]) -> None:
        start = stream.read(len(MCAP0_MAGIC))
        if not start:
            raise UsageError(f"{self.path} is empty; nothing can be recovered")
        if start != MCAP0_MAGIC:
            raise UsageError(
                f"{self.path} is not an MCAP file (wrong magic bytes at the start); nothing can be recovered"
            )

    def _summary(self, stream: IO[bytes]) -> Summary:
        """The summary if the file still has one: it repeats definitions that a damaged chunk may hold."""
        try:
            check_ends(self.path)
            return read_summary(stream) or Summary()
        except (AdvpipeError, *DAMAGE):
            return Summary()

    def _records(self, stream: IO[bytes], chunk_starts: list[int]) -> Iterator[Record]:
        """All complete records; after a damaged one, continue at the next chunk that the summary lists."""
        size = self.path.stat().st_size
        good = start = len(MCAP0_MAGIC)
        while start < size:
            try:
                for record in read_records(stream, start, size):
                    good = record.end
                    yield record
                    if record.opcode == Opcode.DATA_END:
                        return
            except DAMAGE:
                pass
            start = min((offset for offset in chunk_starts if offset > good), default=size)
            self.lost_bytes += start - good
            good = start

    def _read(self, records: list[tuple[int, memoryview]]) -> Iterator[RawMessage]:
        for opcode, body in records:
            if opcode != Opcode.MESSAGE:
                with suppress(*DAMAGE):
                    self._define(parse_record(opcode, body))
                continue
            message = parse_message(body)
            if message.channel_id not in self._topics:  # defined in a chunk that is lost
                self.lost_messages += 1
                continue
            topic, schema = self._topics[message.channel_id]
            yield RawMessage(
                topic=topic,
                schema=schema.data.decode(),
                cdr=bytes(message.data),
                log_time_ns=message.log_time_ns,
                publish_time_ns=message.publish_time_ns,
                sequence=message.sequence,
                schema_encoding=schema.encoding,
            )

    def _define(self, record: object) -> None:
        if isinstance(record, Metadata):
            self.metadata[record.name] = record.metadata
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel) and record.schema_id in self._schemas:
            schema = self._schemas[record.schema_id]
            self._topics[record.id] = ros2_topic(self.path, record, schema), schema


def _decompressed_records(body: bytes, budget: UnpackBudget) -> list[tuple[int, memoryview]] | None:
    """The records of a chunk; None for a chunk that is damaged or decompresses to too much."""
    try:
        return [(opcode, inside) for opcode, _, inside in inner_records(budget.unpack(parse_chunk(body)))]
    except DAMAGE:
        return None


def _entries(body: bytes) -> int:
    """The number of messages in an index; 0 for a damaged index."""
    try:
        return len(parse_message_index(body)[1])
    except DAMAGE:
        return 0


def _compressed_bytes(body: bytes) -> int:
    """The bytes of compressed data in a chunk, or of the whole record if its header is damaged."""
    try:
        return len(parse_chunk(body).data)
    except DAMAGE:
        return len(body)
