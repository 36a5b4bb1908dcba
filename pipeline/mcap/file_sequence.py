"""The .mcap files of one bag, read in log-time order: a file is opened when its first message is due."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.reader import LATEST_NS, McapFile


class FileSequence:
    """The files of a recording of hours are many: to read one frame, or the next message, takes one of them.

    files: in the order of recording, as the bag lists them; files may overlap in time.
    """

    def __init__(self, files: Sequence[McapFile]) -> None:
        self._files = files
        spans_ns = np.array([file.span_ns for file in files], np.uint64).reshape(-1, 2)
        self._first_ns, self._last_ns = spans_ns.T

    def raw_messages(
        self, topic_names: Collection[str] | None, first_ns: int | None, last_ns: int | None
    ) -> Iterator[RawMessage]:
        """Messages in log-time order, see `McapFile.raw_messages`; at equal times, the earlier file's come
        first."""
        first = np.uint64(max(first_ns or 0, 0))
        last = np.uint64(LATEST_NS if last_ns is None else min(max(last_ns, 0), LATEST_NS))
        within = np.flatnonzero((self._last_ns >= first) & (self._first_ns <= last))
        for places in self._overlapping(within):
            streams = [self._files[place].raw_messages(topic_names, first_ns, last_ns) for place in places]
            yield from (
                streams[0] if len(streams) == 1 else heapq.merge(*streams, key=lambda raw: raw.log_time_ns)
            )

    def _overlapping(self, places: npt.NDArray[np.intp]) -> Iterator[list[int]]:
        """The places of the files that overlap in time, group by group, in the order of time."""
        group: list[int] = []
        last_ns = 0
        for place in places[np.argsort(self._first_ns[places], kind="stable")].tolist():
            if group and int(self._first_ns[place]) > last_ns:
                yield sorted(group)
                group = []
            group.append(place)
            last_ns = max(last_ns, int(self._last_ns[place]))
        if group:
            yield sorted(group)
