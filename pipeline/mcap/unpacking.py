"""Limits how much one pass over an .mcap file may decompress, so that a small file cannot take hours."""

from __future__ import annotations

from mcap.records import Chunk

from advpipe.pipeline.mcap.records import unpack_chunk

FREE_BYTES = 1 << 30
RATIO = 100
"""Decompressed data may take a gigabyte, plus `RATIO` times the file's bytes: compression halves clouds, and
reduces text to a tenth."""

MESSAGE_BYTES = 256
"""The cost of a message beyond its bytes. An index stores 16 uncompressed bytes for each message, so an
indexed file never exhausts the budget."""


class UnpackBudget:
    """The budget of decompressed bytes of one pass over a file of `file_bytes` bytes."""

    def __init__(self, file_bytes: int) -> None:
        self._most_bytes = FREE_BYTES + RATIO * file_bytes
        self._taken_bytes = 0

    def unpack(self, chunk: Chunk) -> bytes:
        """Decompress as `records.unpack_chunk`; raises ValueError once the file exceeds its budget."""
        self._take(chunk.uncompressed_size)
        return unpack_chunk(chunk)

    def count_messages(self, count: int) -> None:
        """Count messages. Raises ValueError once the file exceeds its budget."""
        self._take(count * MESSAGE_BYTES)

    def _take(self, size_bytes: int) -> None:
        self._taken_bytes += size_bytes
        if self._taken_bytes > self._most_bytes:
            raise ValueError(f"it decompresses to more than {self._most_bytes} bytes, too many for its size")
