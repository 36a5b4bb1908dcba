"""The points of one turn before they become a cloud; of several returns of a ray, the strongest counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


class Points(NamedTuple):
    """N points of one turn: rays (N,) int64 ascending, range_m (N,), signal (N,), objects (N,) as in Hits."""

    rays: npt.NDArray[np.int64]
    range_m: Float32
    signal: Float32
    objects: npt.NDArray[np.int32]

    def with_stronger(self, others: Points, reach_m: Float32) -> Points:
        """The points, each replaced by another of its ray that is stronger and nearer than reach_m (R,).

        A sensor reports the strongest return. The rays of the others need no order; each is there once.
        """
        at = np.searchsorted(self.rays, others.rays)
        is_there = at < len(self.rays)
        is_there[is_there] = self.rays[at[is_there]] == others.rays[is_there]
        power = np.zeros(len(at), np.float32)
        same = at[is_there]
        power[is_there] = self.signal[same] / np.square(self.range_m[same])
        wins = others.signal > power * np.square(others.range_m)
        wins &= others.range_m < reach_m[others.rays]
        replaced, added = np.flatnonzero(wins & is_there), np.flatnonzero(wins & ~is_there)
        added = added[np.argsort(others.rays[added])]
        count = len(self.rays)
        chosen = np.arange(count)
        chosen[at[replaced]] = count + replaced
        chosen = np.insert(chosen, at[added], count + added)
        return Points(
            np.concatenate([self.rays, others.rays])[chosen],
            np.concatenate([self.range_m, others.range_m])[chosen],
            np.concatenate([self.signal, others.signal])[chosen],
            np.concatenate([self.objects, others.objects])[chosen],
        )
