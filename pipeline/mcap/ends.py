"""Whether a file begins and ends as an .mcap file does."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from advpipe.pipeline.core.errors import AdvpipeError, UsageError

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, summary offset start, summary CRC
_BLOCK_BYTES = 1 << 20


def check_ends(path: Path) -> None:
    """Check both ends of a file, and the checksum of its summary if it has one.

    Raises UsageError for a file that is not MCAP, and AdvpipeError for a truncated or damaged one.
    """
    size = path.stat().st_size
    magic_bytes = len(MCAP0_MAGIC)
    with path.open("rb") as stream:
        if size == 0:
            raise UsageError(f"{path} is empty, not an MCAP file")
        if stream.read(magic_bytes) != MCAP0_MAGIC:
            raise UsageError(f"{path} is not an MCAP file (wrong magic bytes at the start)")
        if size < 2 * magic_bytes + _FOOTER.size:
            raise AdvpipeError(f"{path} is truncated: {size} bytes are too few for an MCAP file")
        stream.seek(-(_FOOTER.size + magic_bytes), 2)
        footer = stream.read(_FOOTER.size)
        if stream.read() != MCAP0_MAGIC:
            raise AdvpipeError(
                f"{path} is truncated: the end of the MCAP file is missing; `advpipe recover` saves the rest"
            )
        _, _, summary_start, _, summary_crc = _FOOTER.unpack(footer)
        if not summary_crc or not summary_start:
            return
        length, crc = size - magic_bytes - 4 - summary_start, 0
        stream.seek(min(summary_start, size))  # systems refuse to seek to a huge offset
        while length > 0 and (block := stream.read(min(length, _BLOCK_BYTES))):
            length, crc = length - len(block), zlib.crc32(block, crc)
        if length or crc != summary_crc:
            raise AdvpipeError(f"{path}: damaged (summary checksum)")
