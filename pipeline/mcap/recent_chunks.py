"""The chunks of .mcap files that were read last: neighbouring frames share them, and are read one by one."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from threading import Lock

from mcap.opcode import Opcode

from advpipe.pipeline.mcap.records import InnerMessage, inner_records, parse_message

KEPT_BYTES = 8 << 20
"""Of all decompressed chunks that a process keeps."""

LARGEST_BYTES = 4 << 20
"""Larger chunks are not kept: usual ones hold a megabyte, or one cloud."""


@dataclass(frozen=True)
class UnpackedChunk:
    """The messages of a chunk by channel, each with its offset in the chunk; size_bytes: decompressed."""

    size_bytes: int
    count: int
    by_channel: dict[int, list[tuple[int, InnerMessage]]]

    @classmethod
    def of(cls, data: bytes) -> UnpackedChunk:
        """Raises ValueError or struct.error for damaged records."""
        by_channel: dict[int, list[tuple[int, InnerMessage]]] = {}
        count = 0
        for opcode, offset, body in inner_records(data):
            if opcode == Opcode.MESSAGE:
                message = parse_message(body)
                by_channel.setdefault(message.channel_id, []).append((offset, message))
                count += 1
        return cls(len(data), count, by_channel)

    def messages(self, channel_ids: Collection[int]) -> Iterator[tuple[int, InnerMessage]]:
        """Those of some channels, with their offsets."""
        for channel_id in channel_ids:
            yield from self.by_channel.get(channel_id, ())


class RecentChunks:
    """Keeps the chunks that were used last, by a file's own key and the place of the chunk in it."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[object, int], UnpackedChunk] = OrderedDict()
        self._bytes, self._lock = 0, Lock()

    def find(self, file: object, start: int) -> UnpackedChunk | None:
        """The chunk, if it is kept."""
        with self._lock:
            found = self._kept.get((file, start))
            if found is not None:
                self._kept.move_to_end((file, start))
            return found

    def keep(self, file: object, start: int, chunk: UnpackedChunk) -> None:
        """Keep a chunk, and forget the ones that were not used for longest."""
        with self._lock:
            if (file, start) in self._kept:
                return
            self._kept[file, start] = chunk
            self._bytes += chunk.size_bytes
            while self._bytes > KEPT_BYTES:
                _, old = self._kept.popitem(last=False)
                self._bytes -= old.size_bytes


RECENT_CHUNKS = RecentChunks()
