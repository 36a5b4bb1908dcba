"""Splits an .mcap file into records, and joins them again with correct lengths, offsets and checksums."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.DATA_END: DataEnd,
}
PACK = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": lambda data: data}
UNPACK = {"zstd": zstandard.decompress, "lz4": lz4.frame.decompress, "": lambda data: data}


@dataclass
class Node:
    """A record: its body, or of a chunk its head and the records inside. start: where it was in the file."""

    opcode: int
    body: bytes
    start: int = -1
    chunk: Chunk | None = None
    inside: list[Node] = field(default_factory=list)

    def value(self) -> Any:
        """The record with its fields; None for one that the library has no class for."""
        kind = KINDS.get(self.opcode)
        if self.opcode == Opcode.MESSAGE:
            return Message.read(ReadDataStream(BytesIO(self.body)), len(self.body))
        return kind.read(ReadDataStream(BytesIO(self.body))) if kind and kind is not Chunk else None


def take_apart(data: bytes) -> list[Node]:
    """The records of a whole file, those in chunks unpacked."""
    nodes = list(_nodes(data, len(MCAP0_MAGIC), len(data) - len(MCAP0_MAGIC)))
    for node in nodes:
        if node.opcode == Opcode.CHUNK:
            node.chunk = chunk = Chunk.read(ReadDataStream(BytesIO(node.body)))
            unpacked = UNPACK[chunk.compression](chunk.data)
            node.inside = list(_nodes(unpacked, 0, len(unpacked)))
    return nodes


def _nodes(data: bytes, place: int, end: int) -> Iterable[Node]:
    while place < end:
        opcode, length = struct.unpack_from("<BQ", data, place)
        yield Node(opcode, data[place + 9 : place + 9 + length], place)
        place += 9 + length


def body_of(record: Any) -> bytes:
    """A record's bytes without opcode and length. Raises struct.error for values that do not fit."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())[9:]


def packed(node: Node) -> bytes:
    """The body of a chunk, of what is inside it now."""
    assert node.chunk is not None
    data, compression = b"".join(map(_bytes, node.inside)), node.chunk.compression
    stored = PACK.get(compression, PACK[""])(data)
    return body_of(
        Chunk(compression, stored, node.chunk.message_end_time, node.chunk.message_start_time,
              zlib.crc32(data), len(data))
    )  # fmt: skip


def put_together(nodes: Iterable[Node]) -> bytes:
    """The file with every place and checksum as its records now are; places of records that went stay."""
    nodes, place = list(nodes), len(MCAP0_MAGIC)
    moved: dict[int, tuple[int, int]] = {}
    for node in nodes:
        moved.setdefault(node.start, (place, 9 + len(node.body)))
        place += 9 + len(node.body)
    data, summary_start = bytearray(MCAP0_MAGIC), 0
    for node in nodes:
        body = _fixed(node, moved)
        if node.opcode == Opcode.DATA_END and len(body) == 4:
            body, summary_start = struct.pack("<I", zlib.crc32(data)), len(data) + 13
        if node.opcode == Opcode.FOOTER and len(body) == 20:
            _, offsets_start, _ = struct.unpack("<QQI", body)
            head = struct.pack("<QQ", summary_start, moved.get(offsets_start, (0, 0))[0])
            crc = zlib.crc32(data[summary_start:] + struct.pack("<BQ", node.opcode, 20) + head)
            body = head + struct.pack("<I", crc)
        data += _bytes(Node(node.opcode, body))
    return bytes(data) + MCAP0_MAGIC


def _fixed(node: Node, moved: dict[int, tuple[int, int]]) -> bytes:
    try:
        value = node.value()
        if isinstance(value, ChunkIndex):
            value.chunk_start_offset, value.chunk_length = moved.get(
                value.chunk_start_offset, (value.chunk_start_offset, value.chunk_length)
            )
            value.message_index_offsets = {
                channel: moved.get(place, (place, 0))[0]
                for channel, place in value.message_index_offsets.items()
            }
            return body_of(value)
        if isinstance(value, MetadataIndex):
            value.offset, value.length = moved.get(value.offset, (value.offset, value.length))
            return body_of(value)
    except Exception:  # a body that was changed is no record any more, and stays as it is
        return node.body
    return node.body


def _bytes(node: Node) -> bytes:
    return struct.pack("<BQ", node.opcode, len(node.body)) + node.body
