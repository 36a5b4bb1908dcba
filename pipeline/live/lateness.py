"""How late messages were published, in bounded memory."""

from __future__ import annotations

import numpy as np

_EDGES_S = np.concatenate([np.arange(1, 20_001) * 1e-4, 2 + np.arange(1, 9_801) * 1e-2])


class Lateness:
    """Counts how late messages were, in bins of 0.1 ms up to 2 s and of 10 ms up to 100 s, and the most."""

    def __init__(self) -> None:
        self._counts = np.zeros(len(_EDGES_S) + 1, np.int64)
        self.max_s = 0.0

    def add(self, late_s: float) -> None:
        """Count one message; one that was early, by the clock's resolution, was not late."""
        self._counts[np.searchsorted(_EDGES_S, late_s, side="right")] += 1
        self.max_s = max(self.max_s, late_s)

    def percentile_s(self, percent: float) -> float:
        """The lateness that this share of the messages did not exceed, to its bin; 0 without messages."""
        below = np.cumsum(self._counts)
        if not below[-1]:
            return 0.0
        place = int(np.searchsorted(below, below[-1] * percent / 100))
        return min(float(_EDGES_S[place]), self.max_s) if place < len(_EDGES_S) else self.max_s
