"""Counts the messages that a reliable subscriber can no longer receive, since it is too slow."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event, Thread

from advpipe.pipeline.core.verbosity import notice

PATIENCE_S = 2.0
"""A subscriber that acknowledges nothing for so long, although it was asked, is too slow."""

ASKING_GAP_S, ASKING_BYTES = 0.1, 500_000
"""Cyclone asks for an acknowledgement with a message that comes so long after the one before it, or is so
large (its HeartbeatInterval and WhcHigh), and when no further message comes; otherwise it may not ask."""

_PAUSE_S = 0.5


class AcknowledgementWatch:
    """Watches one writer, in a thread of its own, since acknowledgements have to be waited for.

    A writer keeps the last `depth` messages; what leaves them before everybody has acknowledged it cannot be
    sent again. Counted are those that left while an older one had no acknowledgement for `PATIENCE_S`.
    is_acknowledged: waits for so many seconds at most, and returns whether all subscribers have acknowledged
    what was written before the call.
    """

    def __init__(self, topic_name: str, depth: int, is_acknowledged: Callable[[float], bool]) -> None:
        self.missed = 0
        self.topic_name, self._depth = topic_name, depth
        self._is_acknowledged = is_acknowledged
        self._written = self._acknowledged = self._gone = 0
        self._written_s, self._asked_s = 0.0, float("inf")
        self._has_ended = Event()
        self._thread = Thread(target=self._watch, name=f"acknowledgements of {topic_name}", daemon=True)
        self._thread.start()

    def count(self, size_bytes: int) -> None:
        """One more message was written."""
        before_s, self._written_s = self._written_s, time.monotonic()
        if self._written_s - before_s > ASKING_GAP_S or size_bytes > ASKING_BYTES:
            self._asked_s = min(self._asked_s, self._written_s)
        self._written += 1

    def end(self) -> None:
        """Nothing more is written; the watch waits once more, and then nothing is kept any longer."""
        self._has_ended.set()

    def join(self) -> None:
        """Wait until it has waited."""
        self._thread.join()

    def _watch(self) -> None:
        while not self._has_ended.wait(_PAUSE_S):
            self._look(is_last=False)
        self._look(is_last=True)

    def _look(self, *, is_last: bool) -> None:
        """Messages are acknowledged in their order: without that of one, all later ones are without, too."""
        self._asked_s, awaited = float("inf"), self._written
        if awaited == self._acknowledged:
            return
        if self._is_acknowledged(PATIENCE_S):
            self._acknowledged = awaited
        elif is_last or time.monotonic() - self._asked_s > PATIENCE_S / 2:
            gone, first = self._written - (0 if is_last else self._depth), max(awaited - 1, self._gone)
            if gone > first:
                self._say_once()
                self.missed += gone - first
                self._gone = gone

    def _say_once(self) -> None:
        if not self.missed:
            notice(
                f"{self.topic_name}: a reliable subscriber is too slow, or gone: it has acknowledged nothing "
                f"for {PATIENCE_S:g} s and misses what is older than the last {self._depth}"
            )
