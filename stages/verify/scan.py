"""One pass over a file's bytes: SHA-256 in one thread, the checksums of MCAP in another."""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from io import FileIO
from itertools import cycle
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import DataEnd, Footer, Header
from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.mcap.reader import DAMAGE
from advpipe.pipeline.mcap.records import HEAD, parse_record, read_records
from advpipe.pipeline.mcap.summary import FOOTER_BYTES

BLOCK_BYTES = 1 << 20
_BLOCKS = 3  # one is read while two wait to be hashed
_MAGIC_BYTES = len(MCAP0_MAGIC)
_DATA_END_BYTES = HEAD.size + 4
_CRC_BYTES = 4
OWN_LIBRARY = "advpipe"
"""The library in the header of advpipe's writer, which writes all checksums."""


@dataclass(frozen=True)
class FileScan:
    """A file's SHA-256, and the faults of an .mcap file's checksums.

    covered: whether the checksums of the data section and of the summary cover all of it.
    """

    sha256: str
    faults: tuple[str, ...] = ()
    covered: bool = True


@dataclass(frozen=True)
class _Span:
    """A range of bytes of a file and its stated CRC-32; 0 for none."""

    name: str
    start: int
    end: int
    crc: int


def scan(path: Path) -> FileScan:
    """Read a file once, block by block. Raises only OSError."""
    spans, fault, covered, is_own = list[_Span](), "", True, False
    with path.open("rb", buffering=0) as stream:
        if path.suffix == ".mcap":
            try:
                spans, is_own = list(_spans(stream)), _is_own(stream)
                covered = all(span.crc for span in spans)
            except DAMAGE as error:
                fault = f"not a complete MCAP file: {error}" if str(error) else "not a complete MCAP file"
        stream.seek(0)
        sha256, crcs = _sums(stream, spans)
    faults = [fault] if fault else []
    for span, crc in zip(spans, crcs, strict=True):
        if span.crc and crc != span.crc:
            faults.append(f"the checksum of the {span.name} is wrong")
        elif not span.crc and is_own:
            faults.append(f"the checksum of the {span.name} is missing, though advpipe always writes one")
    return FileScan(sha256, tuple(faults), covered)


def _sums(stream: FileIO, spans: list[_Span]) -> tuple[str, list[int]]:
    """SHA-256 of the rest of a file, and the CRC-32 of each span, computed in parallel for a large file."""
    sha256, crcs, start = hashlib.sha256(), [0] * len(spans), 0
    size = os.fstat(stream.fileno()).st_size
    is_small = size <= BLOCK_BYTES  # not worth a thread, or allocating three blocks
    length, count = (max(size, 1), 1) if is_small else (BLOCK_BYTES, _BLOCKS)
    blocks = cycle([memoryview(bytearray(length)) for _ in range(count)])
    hashing: deque[Future[None]] = deque()
    with ThreadPoolExecutor(1) as hasher:
        for block in blocks:
            if len(hashing) == _BLOCKS:  # the oldest one still reads this block
                hashing.popleft().result()
            part = block[: stream.readinto(block)]
            if not part:
                break
            if is_small:
                sha256.update(part)
            else:
                hashing.append(hasher.submit(sha256.update, part))
            for index, span in enumerate(spans):
                inside = part[max(span.start - start, 0) : max(span.end - start, 0)]
                if span.crc and inside:
                    crcs[index] = zlib.crc32(inside, crcs[index])
            start += len(part)
    return sha256.hexdigest(), crcs


def _spans(stream: IO[bytes]) -> Iterator[_Span]:
    """The spans that the file's checksums cover: together all of it except the checksums and the last
    magic."""
    size = stream.seek(0, 2)
    stream.seek(max(size - _MAGIC_BYTES, 0))
    if stream.read() != MCAP0_MAGIC or size < 2 * _MAGIC_BYTES + FOOTER_BYTES:
        raise ValueError("its end is missing")
    stream.seek(0)
    if stream.read(_MAGIC_BYTES) != MCAP0_MAGIC:
        raise ValueError("wrong magic bytes at the start")
    footer_start, end = size - _MAGIC_BYTES - FOOTER_BYTES, size - _MAGIC_BYTES
    footer = parse_record(*_record(stream, footer_start, end))
    if not isinstance(footer, Footer):
        raise ValueError("its footer is missing")
    data_end_start = (footer.summary_start or footer_start) - _DATA_END_BYTES
    if data_end_start < _MAGIC_BYTES:
        raise ValueError("its footer states an invalid offset")
    data_end = parse_record(*_record(stream, data_end_start, data_end_start + _DATA_END_BYTES))
    if not isinstance(data_end, DataEnd):
        raise ValueError("the data section does not end where the summary begins")
    yield _Span("data section", 0, data_end_start, data_end.data_section_crc)
    start = footer.summary_start or footer_start
    yield _Span("summary", start, end - _CRC_BYTES, footer.summary_crc)


def _record(stream: IO[bytes], start: int, end: int) -> tuple[int, bytes]:
    """The only record between two offsets."""
    record = next(read_records(stream, start, end))
    if record.end != end:
        raise struct.error(f"the record at {start} has an unexpected length")
    return record.opcode, record.body


def _is_own(stream: IO[bytes]) -> bool:
    """Whether advpipe wrote the file, by its header."""
    end = stream.seek(0, 2)
    first = next(read_records(stream, _MAGIC_BYTES, end, (Opcode.HEADER,)))
    header = parse_record(first.opcode, first.body) if first.body else None
    return isinstance(header, Header) and header.library == OWN_LIBRARY
