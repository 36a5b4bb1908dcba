"""How late messages were published, in bounded memory."""

from __future__ import annotations

import numpy as np

_BINS = 20_000
_BIN_S = 1e-4


class Lateness:
    """Counts how late messages were, in bins of 0.1 ms up to 2 s; the latest one exactly."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS, np.int64)
        self.max_s = 0.0

    def add(self, late_s: float) -> None:
        """Count one message; one that was early, by the clock's resolution, was not late."""
        self._counts[min(int(max(late_s, 0.0) / _BIN_S), _BINS - 1)] += 1
        self.max_s = max(self.max_s, late_s)

    def percentile_s(self, percent: float) -> float:
        """The lateness that this share of the messages did not exceed, to 0.1 ms; 0 without messages."""
        below = np.cumsum(self._counts)
        if not below[-1]:
            return 0.0
        edge = int(np.searchsorted(below, below[-1] * percent / 100)) + 1
        return min(edge * _BIN_S, self.max_s)
