"""How much one pass over an .mcap file may unpack, so that a few kilobytes do not cost hours."""

from __future__ import annotations

from mcap.records import Chunk

from advpipe.pipeline.mcap.records import unpack_chunk

FREE_BYTES = 1 << 30
RATIO = 100
"""What is packed may hold a gigabyte, and beyond that so many times the file's bytes: clouds pack to a half,
text to a tenth."""

MESSAGE_BYTES = 256
"""What a message costs beyond its bytes. An index tells of each in 16 bytes that are never packed, so a file
that has one never comes to its end."""


class UnpackBudget:
    """Of one pass over a file of so many bytes."""

    def __init__(self, file_bytes: int) -> None:
        self._most_bytes = FREE_BYTES + RATIO * file_bytes
        self._taken_bytes = 0

    def unpack(self, chunk: Chunk) -> bytes:
        """As `mcap_records.unpack`; raises ValueError once the file has unpacked to too much."""
        self._take(chunk.uncompressed_size)
        return unpack_chunk(chunk)

    def count_message(self) -> None:
        """Raises ValueError where the file has held too many messages."""
        self._take(MESSAGE_BYTES)

    def _take(self, size_bytes: int) -> None:
        self._taken_bytes += size_bytes
        if self._taken_bytes > self._most_bytes:
            raise ValueError(f"it decompresses to more than {self._most_bytes} bytes, too many for its size")
