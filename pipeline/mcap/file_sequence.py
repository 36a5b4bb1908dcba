"""The .mcap files of one bag, read in log-time order: each is open from its first message to its last."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.reader import LATEST_NS, McapFile, log_time


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
        first = log_time(first_ns or 0)
        last = log_time(LATEST_NS if last_ns is None else last_ns)
        # Each file once, by the time of its next message; of a file that is not open yet, the index tells it.
        waiting: list[tuple[int, int, RawMessage | None, Iterator[RawMessage]]] = []
        for place in np.flatnonzero((self._last_ns >= first) & (self._first_ns <= last)).tolist():
            stream = self._files[place].raw_messages(topic_names, first_ns, last_ns)
            waiting.append((int(self._first_ns[place]), place, None, stream))
        heapq.heapify(waiting)
        while waiting:
            _, place, due, stream = heapq.heappop(waiting)
            if due is not None:
                yield due
            for raw in stream:
                if waiting and waiting[0][:2] < (raw.log_time_ns, place):
                    heapq.heappush(waiting, (raw.log_time_ns, place, raw, stream))
                    break
                yield raw
