"""Read what is whole of a damaged or cut-off .mcap file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.bag.mcap_file import DAMAGE, check_ends, ros2_topic
from advpipe.pipeline.bag.topics import RawMessage, Topic
from advpipe.pipeline.errors import AdvpipeError


@dataclass
class Salvage:
    """The whole messages of one file, and a tally of the rest, which fills while they are read.

    A chunk is saved whole or not at all: its checksum has to be right. lost_messages: those of damaged
    chunks that an index still counts; nothing tells how many were in what is cut off. lost_bytes: of the
    file, in damaged chunks and in what is no whole record. metadata: records by name.
    """

    path: Path
    lost_chunks: int = 0
    lost_messages: int = 0
    lost_bytes: int = 0
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _topics: dict[int, tuple[Topic, Schema]] = field(default_factory=dict)

    def messages(self) -> Iterator[RawMessage]:
        """The messages in the order of the file; AdvpipeError for a file that never was a ROS 2 bag."""
        with self.path.open("rb") as stream:
            self._check_start(stream)
            summary = self._summary(stream)
            for record in (*summary.schemas.values(), *summary.channels.values()):
                self._define(record)
            chunk_starts = [index.chunk_start_offset for index in summary.chunk_indexes]
            is_damaged = False
            for record in self._records(stream, chunk_starts):
                if isinstance(record, MessageIndex):
                    self.lost_messages += len(record.records) if is_damaged else 0
                elif isinstance(record, Metadata):
                    self.metadata[record.name] = record.metadata
                elif isinstance(record, Chunk):
                    inside = _unpacked(record)
                    is_damaged = inside is None
                    self.lost_chunks += is_damaged
                    self.lost_bytes += len(record.data) if is_damaged else 0
                    yield from self._read(inside or [])
                else:
                    yield from self._read([record])

    def _check_start(self, stream: IO[bytes]) -> None:
        start = stream.read(len(MCAP0_MAGIC))
        if not start:
            raise AdvpipeError(f"{self.path} is empty; nothing can be saved")
        if start != MCAP0_MAGIC:
            raise AdvpipeError(f"{self.path} is no MCAP file (wrong first bytes); nothing can be saved")

    def _summary(self, stream: IO[bytes]) -> Summary:
        """The summary where the file still has one: it repeats what a damaged chunk may have defined."""
        try:
            check_ends(self.path)
            stream.seek(0)
            return make_reader(stream).get_summary() or Summary()
        except (AdvpipeError, *DAMAGE):
            return Summary()

    def _records(self, stream: IO[bytes], chunk_starts: list[int]) -> Iterator[McapRecord]:
        """All whole records; behind a damaged one it goes on at the next chunk that the summary names."""
        size = self.path.stat().st_size
        good = start = len(MCAP0_MAGIC)
        while start < size:
            stream.seek(start)
            reader = StreamReader(stream, skip_magic=True, emit_chunks=True, record_size_limit=size)
            try:
                for record in reader.records:
                    good = stream.tell()
                    yield record
                    if isinstance(record, DataEnd):
                        return
            except DAMAGE:
                pass
            start = min((place for place in chunk_starts if place > good), default=size)
            self.lost_bytes += start - good
            good = start

    def _read(self, records: list[McapRecord]) -> Iterator[RawMessage]:
        for record in records:
            if not isinstance(record, Message):
                self._define(record)
            elif record.channel_id not in self._topics:  # defined in a chunk that is lost
                self.lost_messages += 1
            else:
                topic, schema = self._topics[record.channel_id]
                yield RawMessage(
                    topic=topic,
                    schema=schema.data.decode(),
                    cdr=record.data,
                    log_time_ns=record.log_time,
                    publish_time_ns=record.publish_time,
                    sequence=record.sequence,
                    schema_encoding=schema.encoding,
                )

    def _define(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel) and record.schema_id in self._schemas:
            schema = self._schemas[record.schema_id]
            self._topics[record.id] = ros2_topic(self.path, record, schema), schema


def _unpacked(chunk: Chunk) -> list[McapRecord] | None:
    """The records of a chunk; None for a damaged one."""
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except DAMAGE:
        return None
