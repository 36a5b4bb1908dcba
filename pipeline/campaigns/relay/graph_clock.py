"""The time of a ROS 2 graph: that of /clock where somebody publishes it, otherwise the system's."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

from advpipe.pipeline.core.errors import AdvpipeError

_LONGEST_GAP_NS = 100_000_000
"""Between two ticks, time goes on for so long at most."""

_JITTER_NS = 1_000_000_000
_STAMP = struct.Struct("<iI")


class ClockJumpedBackError(AdvpipeError):
    """/clock shows an earlier time than before, as when a player begins again."""


class GraphClock:
    """Tells ROS time, which never goes backwards: small jitter of ticks is evened out."""

    def __init__(
        self,
        system_ns: Callable[[], int] = time.time_ns,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._system_ns, self._monotonic_ns = system_ns, monotonic_ns
        self._tick: tuple[int, int] | None = None
        self._last_ns = 0

    @property
    def has_ticked(self) -> bool:
        """Whether /clock was received."""
        return self._tick is not None

    def tick(self, cdr: bytes) -> None:
        """Take a serialised rosgraph_msgs/Clock. Raises ClockJumpedBackError for an earlier time."""
        try:
            seconds, nanoseconds = _STAMP.unpack_from(cdr, 4)
        except struct.error:
            return
        tick_ns = seconds * 10**9 + nanoseconds
        if self._tick is not None and tick_ns < self._last_ns - _JITTER_NS:
            back_s = (self._last_ns - tick_ns) * 1e-9
            raise ClockJumpedBackError(f"/clock jumped back by {back_s:.1f} s")
        self._tick = tick_ns, self._monotonic_ns()

    def now_ns(self) -> int:
        """The time now."""
        if self._tick is None:
            now_ns = self._system_ns()
        else:
            tick_ns, at_ns = self._tick
            now_ns = tick_ns + min(self._monotonic_ns() - at_ns, _LONGEST_GAP_NS)
        self._last_ns = max(self._last_ns, now_ns)
        return self._last_ns
