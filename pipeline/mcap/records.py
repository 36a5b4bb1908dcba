"""A bounded reader of MCAP records: a length in a file is used only after it has been checked."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from typing import IO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import numpy.typing as npt
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

RECORD_LIMIT_BYTES = CHUNK_LIMIT_BYTES = 1 << 29
"""Most bytes of one record, and of one decompressed chunk: hundreds of clouds."""

WINDOW_LIMIT_BYTES = 1 << 27
"""Largest zstd window: `zstd --ultra` needs no more."""

HEAD = struct.Struct("<BQ")  # opcode, and length of the body
_CHUNK = struct.Struct("<QQQII")  # first and last time, uncompressed size and CRC, length of the codec's name
_LENGTH = struct.Struct("<Q")
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_INDEX_HEAD_BYTES = 6  # channel, length of the entries

_READERS: dict[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.FOOTER: Footer.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex.read,
    Opcode.CHUNK_INDEX: ChunkIndex.read,
    Opcode.STATISTICS: Statistics.read,
    Opcode.METADATA: Metadata.read,
    Opcode.METADATA_INDEX: MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: SummaryOffset.read,
    Opcode.DATA_END: DataEnd.read,
}


class Record(NamedTuple):
    """One record of a file: its opcode, its offset, and the bytes after its opcode and length."""

    opcode: int
    start: int
    body: bytes

    @property
    def end(self) -> int:
        """The offset after the record."""
        return self.start + HEAD.size + len(self.body)

    @property
    def bytes(self) -> bytes:
        """The whole record as stored in the file."""
        return HEAD.pack(self.opcode, len(self.body)) + self.body


class InnerMessage(NamedTuple):
    """A message in a decompressed chunk; `data` is a view of the chunk."""

    channel_id: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: memoryview


def read_records(
    stream: IO[bytes], start: int, end: int, wanted: Collection[int] | None = None
) -> Iterator[Record]:
    """Yield the records between two offsets of a file, with one in memory at a time.

    wanted: opcodes; the bodies of other records are skipped and left empty. Raises ValueError for a record
    that extends past the end or is larger than `RECORD_LIMIT_BYTES`.
    """
    while start < end:
        stream.seek(start)
        head = stream.read(HEAD.size)
        if len(head) < HEAD.size or start + HEAD.size > end:
            raise ValueError(f"the {end - start} bytes at {start} are not a record")
        opcode, length = HEAD.unpack(head)
        if length > end - start - HEAD.size:
            raise ValueError(f"the record at {start} declares {length} bytes, past the end of the file")
        body = b""
        if wanted is None or opcode in wanted:
            if length > RECORD_LIMIT_BYTES:
                raise ValueError(f"the record at {start} has {length} bytes, more than are read")
            body = stream.read(length)
            if len(body) != length:
                raise ValueError(f"the record at {start} is truncated")
        yield Record(opcode, start, body)
        start += HEAD.size + length


def parse_record(opcode: int, body: bytes | memoryview) -> McapRecord | None:
    """Parse a record other than a chunk, a message or its index; None for one that MCAP does not define."""
    reader = _READERS.get(opcode)
    return reader(ReadDataStream(BytesIO(body))) if reader else None


def parse_chunk(body: bytes) -> Chunk:
    """Parse a chunk without decompressing it. Raises ValueError if its sizes do not fit the record."""
    start_ns, end_ns, size, crc, name_length = _CHUNK.unpack_from(body)
    data_start = _CHUNK.size + name_length + _LENGTH.size
    if data_start > len(body):
        raise ValueError("the name of a chunk's compression extends past its end")
    name = body[_CHUNK.size : _CHUNK.size + name_length].decode()
    (data_bytes,) = _LENGTH.unpack_from(body, _CHUNK.size + name_length)
    if data_bytes != len(body) - data_start:
        raise ValueError(f"a chunk declares {data_bytes} bytes of data but has {len(body) - data_start}")
    return Chunk(name, body[data_start:], end_ns, start_ns, crc, size)


def parse_message_index(body: bytes) -> tuple[int, npt.NDArray[np.uint64]]:
    """The channel id of a message index, and its entries (K, 2): log time in ns, offset in the chunk.

    Raises ValueError for an invalid length.
    """
    channel_id, length = struct.unpack_from("<HI", body)
    if length != len(body) - _INDEX_HEAD_BYTES or length % 16:
        raise ValueError(f"a message index declares {length} bytes")
    return channel_id, np.frombuffer(body, "<u8", offset=_INDEX_HEAD_BYTES).reshape(-1, 2)


def unpack_chunk(chunk: Chunk, check_crc: bool = True) -> bytes:
    """Decompress a chunk: exactly as many bytes as it declares, at most `CHUNK_LIMIT_BYTES`.

    Raises ValueError, or an exception of the codec, for any other size and for a wrong checksum.
    """
    size = chunk.uncompressed_size
    if size > CHUNK_LIMIT_BYTES:
        raise ValueError(f"a chunk declares {size} bytes; at most {CHUNK_LIMIT_BYTES} are read")
    data = _decompressed(chunk, size)
    if len(data) != size:
        raise ValueError(f"a chunk declares {size} bytes and holds {'more' if len(data) > size else 'less'}")
    if check_crc and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("crc validation failed in Chunk")
    return data


def _decompressed(chunk: Chunk, size: int) -> bytes:
    """The decompressed data, or its first `size` + 1 bytes."""
    if chunk.compression == "":
        return chunk.data
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    if chunk.compression != "zstd":
        raise ValueError(f"a chunk is compressed as {chunk.compression!r}; only zstd and lz4 are supported")
    declared = zstandard.frame_content_size(chunk.data)  # the codec would allocate this much unchecked
    if declared not in (-1, size):
        raise ValueError(f"a chunk declares {size} bytes, its compressed frame {declared}")
    codec = zstandard.ZstdDecompressor(max_window_size=WINDOW_LIMIT_BYTES)
    return codec.decompress(chunk.data, max_output_size=size)


def inner_records(data: bytes) -> Iterator[tuple[int, int, memoryview]]:
    """Yield opcode, offset and body of each record in a decompressed chunk.

    Raises ValueError for a record that extends past the end.
    """
    view, offset = memoryview(data), 0
    while offset < len(data):
        if len(data) - offset < HEAD.size:
            raise ValueError(f"{len(data) - offset} bytes at the end of a chunk are not a record")
        opcode, length = HEAD.unpack_from(view, offset)
        body = offset + HEAD.size
        if length > len(data) - body:
            raise ValueError(
                f"a record in a chunk declares {length} bytes, but only {len(data) - body} are left"
            )
        yield opcode, offset, view[body : body + length]
        offset = body + length


def parse_message(body: memoryview) -> InnerMessage:
    """Parse the header of a message. Raises struct.error if it is too short."""
    channel_id, sequence, log_time_ns, publish_time_ns = _MESSAGE.unpack_from(body)
    return InnerMessage(channel_id, sequence, log_time_ns, publish_time_ns, body[_MESSAGE.size :])
