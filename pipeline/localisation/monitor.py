"""Chi-square tests of a filter's innovations: of a single fix, and of a window of fixes."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64

MONITOR_PROBABILITY = 0.999
"""Of both tests: of genuine fixes, as the filter models them, one in a thousand is above the threshold."""
WINDOW_FIXES = 20
"""Of the windowed test: two seconds at 10 Hz."""


def nis_threshold(fixes: int = 1, probability: float = MONITOR_PROBABILITY) -> float:
    """The quantile of chi-square with 3 degrees of freedom a fix: 16.27 for one fix, 99.61 for twenty."""
    from scipy.special import chdtri

    return float(chdtri(3 * fixes, 1 - probability))


def windowed_alarms(nis: Float64, window: int = WINDOW_FIXES) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether the windowed test fails at each of K fixes: nis (K,), NaN for a fix that is missing.

    It adds up the normalised innovations squared of a fix and of those before it, `window` at most.
    Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation" (2001), section
    5.4: innovations of a filter whose model holds are white, so that their sum is chi-square, and a bias too
    small for the test of a single fix shows in it.
    """
    alarms = np.zeros(len(nis), dtype=bool)
    (known,) = np.nonzero(np.isfinite(nis))
    totals = np.concatenate([[0.0], np.cumsum(nis[known])])
    for count, place in enumerate(known, 1):
        fixes = min(count, window)
        alarms[place] = totals[count] - totals[count - fixes] > nis_threshold(fixes)
    return alarms
