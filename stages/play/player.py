"""Publishes messages when they are due, until they end or somebody stops it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.live.lateness import Lateness
from advpipe.pipeline.live.playback_clock import PlaybackClock
from advpipe.pipeline.live.publisher import Publisher
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.stages.play.keyboard import PAUSE, QUIT, Keyboard

_LOOK_S = 0.1
"""How often it looks whether a signal came."""

_TOO_LATE_S = 1.0


class Player:
    """Counts what it published, by topic, and how late.

    is_stopped: asked while it waits; a signal, for instance.
    """

    def __init__(
        self, publishers: Sequence[Publisher], keyboard: Keyboard, is_stopped: Callable[[], bool]
    ) -> None:
        self._publishers, self._keyboard, self._is_stopped = publishers, keyboard, is_stopped
        self._has_quit = self._was_too_late = False
        self.sent: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.lateness = Lateness()
        self.recorded_ns = 0

    @property
    def has_ended(self) -> bool:
        """Whether somebody stopped it."""
        return self._has_quit or self._is_stopped()

    def delay(self, delay_s: float) -> None:
        """Wait before the first message; a pause is for what is played."""
        end_s = time.monotonic() + delay_s
        while not self.has_ended and (left_s := end_s - time.monotonic()) > 0:
            self._has_quit = self._keyboard.wait(min(left_s, _LOOK_S)) == QUIT

    def publish(self, raw: RawMessage) -> None:
        """Publish one message at once. Raises AdvpipeError for one that is not of its topic's type."""
        was_taken = [
            publisher.publish(raw.topic.name, raw.cdr, raw.log_time_ns) for publisher in self._publishers
        ]
        (self.sent if all(was_taken) else self.dropped)[raw.topic.name] += 1

    def play(self, messages: Iterable[RawMessage], begin_ns: int, rate: float) -> None:
        """Publish messages, which are in the order of their times, from the recorded time `begin_ns` on."""
        clock = PlaybackClock(begin_ns, rate)
        last_ns = begin_ns
        for raw in messages:
            self._wait(clock, raw.log_time_ns)
            if self.has_ended:
                break
            late_s = -clock.left_s(raw.log_time_ns)
            self.publish(raw)
            self.lateness.add(late_s)
            self._say_if_too_late(late_s, rate)
            last_ns = raw.log_time_ns
        self.recorded_ns += last_ns - begin_ns

    def _wait(self, clock: PlaybackClock, time_ns: int) -> None:
        while not self.has_ended and (clock.is_paused or clock.left_s(time_ns) > 0):
            left_s = _LOOK_S if clock.is_paused else min(clock.left_s(time_ns), _LOOK_S)
            self._obey(self._keyboard.wait(left_s), clock)
        if self._keyboard.is_there and not self.has_ended:  # also where it is late, and never waits
            self._obey(self._keyboard.wait(0.0), clock)
            if clock.is_paused:
                self._wait(clock, time_ns)

    def _obey(self, key: str, clock: PlaybackClock) -> None:
        if key == PAUSE:
            clock.toggle_pause()
            notice("paused; space goes on" if clock.is_paused else "goes on")
        elif key == QUIT:
            self._has_quit = True

    def _say_if_too_late(self, late_s: float, rate: float) -> None:
        if late_s > _TOO_LATE_S and not self._was_too_late:
            self._was_too_late = True
            notice(f"this machine does not keep up with rate {rate:g}: messages are {late_s:.1f} s late")
