"""The chunks of a bag's files as probes see them, and the probes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.records import ChunkIndex

from advpipe.pipeline.audit.probe import Float64, Probe
from advpipe.pipeline.mcap.reader import mcap_errors
from advpipe.pipeline.mcap.summary import read_summary
from advpipe.pipeline.messages.debug import is_debug


@dataclass(frozen=True)
class ChunkView:
    """The C chunks of a bag in order; of another tool's file without an index, none. topics: (C,) how many
    each has, without debug topics."""

    chunks: tuple[ChunkIndex, ...]
    topics: tuple[int, ...]

    @classmethod
    def of(cls, files: list[Path]) -> ChunkView:
        """Those of files. Raises AdvpipeError for a damaged one."""
        found: list[ChunkIndex] = []
        topics: list[int] = []
        for path in files:
            with mcap_errors(path), path.open("rb") as stream:
                summary = read_summary(stream)
            if summary is None:
                continue
            found += summary.chunk_indexes
            shown = {key for key, channel in summary.channels.items() if not is_debug(channel.topic)}
            topics += [len(shown & chunk.message_index_offsets.keys()) for chunk in summary.chunk_indexes]
        return cls(tuple(found), tuple(topics))

    def each(self, name: str) -> Float64:
        """A number (C,) of each."""
        return np.array([getattr(chunk, name) for chunk in self.chunks], np.float64)


_COUNTS = ("points_added", "points_removed", "messages_added_per_s", "delay_s")

CHUNK_PROBES: tuple[Probe[ChunkView], ...] = (
    Probe("bytes", "chunk", "bytes before compression", lambda v: v.each("uncompressed_size"), _COUNTS),
    Probe("compression", "chunk", "share that compression leaves",
          lambda v: v.each("compressed_size") / np.maximum(v.each("uncompressed_size"), 1),
          ("max_displacement_m", *_COUNTS)),
    Probe("span", "chunk", "time from its first to its last message",
          lambda v: (v.each("message_end_time") - v.each("message_start_time")) / 1e9, _COUNTS),
    Probe("topics", "chunk", "topics in it",
          lambda v: np.array(v.topics, np.float64), ("messages_added_per_s",)),
)  # fmt: skip
