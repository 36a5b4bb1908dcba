"""When a moment of a recording is due: recorded time against a monotonic clock, with a rate and pauses."""

from __future__ import annotations

import time
from collections.abc import Callable


class PlaybackClock:
    """Maps recorded nanoseconds to those of a monotonic clock. The wall clock is not asked.

    begin_ns: the recorded time that is due now. rate: recorded seconds in a second.
    """

    def __init__(
        self, begin_ns: int, rate: float = 1.0, monotonic_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._monotonic_ns = monotonic_ns
        self._rate = rate
        self._begin_ns = begin_ns
        self._started_ns = monotonic_ns()
        self._paused_ns: int | None = None

    @property
    def is_paused(self) -> bool:
        """Whether recorded time stands still."""
        return self._paused_ns is not None

    def time_ns(self) -> int:
        """The recorded time that is due now."""
        now_ns = self._monotonic_ns() if self._paused_ns is None else self._paused_ns
        return self._begin_ns + round((now_ns - self._started_ns) * self._rate)

    def left_s(self, time_ns: int) -> float:
        """Seconds until a recorded time is due, less than 0 if it is over; as if there were no pause."""
        due_ns = self._started_ns + round((time_ns - self._begin_ns) / self._rate)
        now_ns = self._monotonic_ns() if self._paused_ns is None else self._paused_ns
        return (due_ns - now_ns) * 1e-9

    def toggle_pause(self) -> None:
        """Stand still, or go on from where it stood."""
        if self._paused_ns is None:
            self._paused_ns = self._monotonic_ns()
        else:
            self._started_ns += self._monotonic_ns() - self._paused_ns
            self._paused_ns = None
