"""Reactive decentralised congestion control (ETSI TS 102 687 v1.1.1): fewer messages on a busy channel."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque

from advpipe.pipeline.core.errors import AdvpipeError

SAMPLE_INTERVAL_S = 0.1
UP_SAMPLES = 10
"""Load has to stay high for one second before a station sends less."""
DOWN_SAMPLES = 50
"""Load has to stay low for five seconds before a station sends more."""

STATES = {
    "relaxed": 0.060,
    "active 1": 0.100,
    "active 2": 0.180,
    "active 3": 0.260,
    "active 4": 0.340,
    "active 5": 0.420,
    "restrictive": 0.460,
}
"""Minimum seconds between two messages of a station in each state."""

_NAMES = tuple(STATES)
_RELAXED, _RESTRICTIVE = 0, len(_NAMES) - 1
_RELAXED_BELOW, _RESTRICTIVE_FROM = 0.19, 0.59
_ACTIVE_FROM = (0.27, 0.35, 0.43, 0.51)
"""Channel loads from which active 2 to 5 hold: the table that Artery's Vanetza uses by default."""


class ReactiveDcc:
    """The state of one station, driven by the channel load that it measures every 0.1 s.

    It enters or leaves "relaxed" and "restrictive" when the whole last second (towards fewer messages)
    or the whole last five (towards more) lie beyond a threshold. Among the active states, the highest
    load of the last five seconds decides.
    """

    def __init__(self) -> None:
        # A station that has just been switched on has measured no load.
        self._loads = deque([0.0] * DOWN_SAMPLES, maxlen=DOWN_SAMPLES)
        self._state = _RELAXED

    def update(self, channel_load: float) -> None:
        """Process the share of the last 0.1 s in which the channel was busy.

        Raises AdvpipeError outside of [0, 1].
        """
        if not 0 <= channel_load <= 1:
            raise AdvpipeError(f"channel load {channel_load} is not a share of time in [0, 1]")
        self._loads.append(channel_load)
        if self._state == _RELAXED and channel_load < _RELAXED_BELOW:
            return
        highest = max(self._loads)
        least = min(list(self._loads)[-UP_SAMPLES:])
        if self._state == _RELAXED and least < _RELAXED_BELOW:
            return
        if self._state == _RESTRICTIVE and highest >= _RESTRICTIVE_FROM:
            return
        if self._state not in (_RELAXED, _RESTRICTIVE):
            if highest < _RELAXED_BELOW:
                self._state = _RELAXED
                return
            if least >= _RESTRICTIVE_FROM:
                self._state = _RESTRICTIVE
                return
        self._state = 1 + bisect_right(_ACTIVE_FROM, highest)

    def sent(self, cam_bytes: int) -> None:
        """The length of the station's messages does not matter here."""

    @property
    def state(self) -> str:
        """A key of `STATES`."""
        return _NAMES[self._state]

    @property
    def interval_s(self) -> float:
        """Minimum time between two messages."""
        return STATES[_NAMES[self._state]]
