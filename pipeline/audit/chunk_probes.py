"""The chunks of a bag's files as probes see them, and the probes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.records import ChunkIndex

from advpipe.pipeline.audit.probe import Float64, Probe
from advpipe.pipeline.mcap.reader import mcap_errors
from advpipe.pipeline.mcap.summary import read_summary


@dataclass(frozen=True)
class ChunkView:
    """The C chunks of a bag in order; of another tool's file without an index, none."""

    chunks: tuple[ChunkIndex, ...]

    @classmethod
    def of(cls, files: list[Path]) -> ChunkView:
        """Those of files. Raises AdvpipeError for a damaged one."""
        found: list[ChunkIndex] = []
        for path in files:
            with mcap_errors(path), path.open("rb") as stream:
                summary = read_summary(stream)
            found += [] if summary is None else summary.chunk_indexes
        return cls(tuple(found))

    def each(self, name: str) -> Float64:
        """A number (C,) of each."""
        return np.array([getattr(chunk, name) for chunk in self.chunks], np.float64)


CHUNK_PROBES: tuple[Probe[ChunkView], ...] = (
    Probe("bytes", "chunk", "bytes before compression", lambda v: v.each("uncompressed_size")),
    Probe("compression", "chunk", "share that compression leaves",
          lambda v: v.each("compressed_size") / np.maximum(v.each("uncompressed_size"), 1),
          ("max_displacement_m", "points_added", "points_removed")),
    Probe("span", "chunk", "time from its first to its last message",
          lambda v: (v.each("message_end_time") - v.each("message_start_time")) / 1e9),
    Probe("topics", "chunk", "topics in it",
          lambda v: np.array([len(chunk.message_index_offsets) for chunk in v.chunks], np.float64)),
)  # fmt: skip
