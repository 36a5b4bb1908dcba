"""Writes one .mcap file; chunks are compressed and written in the background.

The file is byte for byte the same as that of `mcap.Writer`, except for the zstd level, which `mcap.Writer`
does not expose. Level 1 compresses LiDAR clouds as well as the default level 3, in little more than half the
time.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.mcap.background import Background

Buffer = bytes | memoryview

ZSTD_LEVEL = 1
COMPRESSIONS: dict[str, Callable[[Buffer], Buffer] | None] = {
    "zstd": partial(zstandard.compress, level=ZSTD_LEVEL),
    "lz4": lz4.frame.compress,
    "none": None,
}
CHUNK_BYTES = 1 << 20
"""A chunk ends with the message that exceeds this size; a cloud usually fills a chunk alone."""
CHUNKS_IN_WAIT = 4

_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_CHUNK = struct.Struct("<BQQQQII")  # opcode, length, start, end, uncompressed size and CRC, name's length
_RECORD_HEAD_BYTES = 9  # opcode and length, which the length field does not count


@dataclass
class _Chunk:
    """The records of a chunk that is not yet full; entries: log time in ns and offset, by channel id."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    times_ns: list[int] = field(default_factory=list)
    entries: dict[int, list[tuple[int, int]]] = field(default_factory=dict)

    def add(self, *parts: bytes) -> None:
        self.parts += parts
        self.size += sum(map(len, parts))

    def joined(self, buffer: bytearray) -> memoryview:
        """The records concatenated in `buffer`, which is enlarged if it is too small."""
        if len(buffer) < self.size:
            buffer.extend(bytes(self.size - len(buffer)))
        end = 0
        for part in self.parts:
            start, end = end, end + len(part)
            buffer[start:end] = part
        return memoryview(buffer)[: self.size]


class McapWriter:
    """A writer of an MCAP file of the `ros2` profile, with chunks, message indexes and every checksum.

    stream: open for writing bytes; `finish` and `abort` leave it open. compression: a key of
    `COMPRESSIONS`. Any method may raise an exception of the stream from an earlier call. At most
    `CHUNKS_IN_WAIT` full chunks are queued in memory besides the ones that are being filled and written.
    """

    def __init__(self, stream: IO[bytes], compression: str = "zstd") -> None:
        self._compress = COMPRESSIONS[compression]
        self._compression = "" if compression == "none" else compression
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = {}
        self._first_ns, self._last_ns = 2**64, 0
        self._chunk = _Chunk()
        # The attributes below are used only by the background thread.
        self._stream = stream
        self._position, self._data_crc = 0, 0
        self._buffer = bytearray()  # reused: allocating megabytes for each chunk is slower than compression
        self._chunk_indexes: list[ChunkIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._background = Background(CHUNKS_IN_WAIT)
        self._background.call(self._write, [MCAP0_MAGIC, _bytes_of([Header("ros2", "advpipe")])])

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema and return its id."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data))
        self._chunk.add(_bytes_of(self._schemas[-1:]))
        return len(self._schemas)

    def add_channel(self, topic: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """Add a channel of CDR messages and return its id."""
        channel_id = len(self._channels) + 1
        self._channels.append(Channel(channel_id, topic, "cdr", dict(metadata), schema_id))
        self._chunk.add(_bytes_of(self._channels[-1:]))
        return channel_id

    def add_message(
        self, channel_id: int, log_time_ns: int, cdr: bytes, publish_time_ns: int, sequence: int
    ) -> None:
        """Add a message to the current chunk, and end the chunk if it is full."""
        chunk, length = self._chunk, _MESSAGE.size - _RECORD_HEAD_BYTES + len(cdr)
        chunk.entries.setdefault(channel_id, []).append((log_time_ns, chunk.size))
        chunk.times_ns.append(log_time_ns)
        chunk.add(
            _MESSAGE.pack(Opcode.MESSAGE, length, channel_id, sequence, log_time_ns, publish_time_ns), cdr
        )
        self._counts[channel_id] = self._counts.get(channel_id, 0) + 1
        if chunk.size > CHUNK_BYTES:
            self._end_chunk()

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._background.call(self._write_metadata, Metadata(name=name, metadata=dict(metadata)))

    def finish(self) -> None:
        """Write the last chunk and the summary, and wait until everything is in the stream."""
        self._end_chunk()
        self._background.call(self._write_end)
        self._background.finish()
        self._buffer, self._chunk_indexes = bytearray(), []  # a bag of many files keeps their writers

    def abort(self) -> None:
        """Stop as soon as possible; afterwards the stream is not used any more."""
        self._background.abort()

    def _end_chunk(self) -> None:
        chunk = self._chunk
        if not chunk.times_ns:
            return
        self._first_ns = min(self._first_ns, *chunk.times_ns)
        self._last_ns = max(self._last_ns, *chunk.times_ns)
        self._background.call(self._write_chunk, chunk)
        self._chunk = _Chunk()

    def _write(self, blocks: Sequence[Buffer]) -> None:
        self._data_crc = _crc(blocks, self._data_crc)
        self._stream.writelines(blocks)
        self._position += sum(map(len, blocks))

    def _write_chunk(self, chunk: _Chunk) -> None:
        start, first_ns, last_ns = self._position, min(chunk.times_ns), max(chunk.times_ns)
        data: Sequence[Buffer] = chunk.parts
        compressed = data
        if self._compress:
            data = [chunk.joined(self._buffer)]
            compressed = [self._compress(data[0])]
        name, compressed_size = self._compression.encode(), sum(map(len, compressed))
        head = _CHUNK.pack(
            Opcode.CHUNK,
            _CHUNK.size - _RECORD_HEAD_BYTES + len(name) + 8 + compressed_size,
            first_ns,
            last_ns,
            chunk.size,
            _crc(data),
            len(name),
        )
        self._write([head, name, struct.pack("<Q", compressed_size), *compressed])
        indexes_start, offsets = self._position, {}
        for channel_id, entries in chunk.entries.items():
            offsets[channel_id] = self._position
            self._write([_bytes_of([MessageIndex(channel_id, entries)])])
        self._chunk_indexes.append(
            ChunkIndex(
                chunk_length=indexes_start - start,
                chunk_start_offset=start,
                compression=self._compression,
                compressed_size=compressed_size,
                message_end_time=last_ns,
                message_index_length=self._position - indexes_start,
                message_index_offsets=offsets,
                message_start_time=first_ns,
                uncompressed_size=chunk.size,
            )
        )
        self._stream.flush()  # so that a killed run leaves all finished chunks

    def _write_metadata(self, record: Metadata) -> None:
        block = _bytes_of([record])
        self._metadata_indexes.append(MetadataIndex(self._position, len(block), record.name))
        self._write([block])

    def _write_end(self) -> None:
        self._write([_bytes_of([DataEnd(self._data_crc)])])
        summary_start, summary, offsets = self._position, b"", []
        for opcode, records in self._summary().items():
            group = _bytes_of(records)
            offsets.append(SummaryOffset(opcode, summary_start + len(summary), len(group)))
            summary += group
        offset_start = summary_start + len(summary)
        summary += _bytes_of(offsets)
        # The checksum covers the footer too, up to the checksum itself.
        footer = Footer(summary_start=summary_start, summary_offset_start=offset_start, summary_crc=0)
        head = _bytes_of([footer])[:-4]
        crc = zlib.crc32(head, zlib.crc32(summary))
        self._stream.write(summary + head + struct.pack("<I", crc) + MCAP0_MAGIC)
        self._stream.flush()

    def _summary(self) -> dict[Opcode, Iterable[McapRecord]]:
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunk_indexes),
            message_count=sum(self._counts.values()),
            message_end_time=self._last_ns,
            message_start_time=self._first_ns if self._counts else 0,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )
        return {
            Opcode.SCHEMA: self._schemas,
            Opcode.CHANNEL: self._channels,
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: self._chunk_indexes,
            Opcode.ATTACHMENT_INDEX: [],
            Opcode.METADATA_INDEX: self._metadata_indexes,
        }


def _crc(blocks: Sequence[Buffer], crc: int = 0) -> int:
    for block in blocks:
        crc = zlib.crc32(block, crc)
    return crc


def _bytes_of(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
