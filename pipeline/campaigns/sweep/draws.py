"""Differences of mAP ratios whose bootstrap drew the same blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.metrics.bootstrap import percentile_interval

Draws = Sequence[float | None]


def paired_interval(before: Draws, after: Draws) -> tuple[float, float] | None:
    """The 95 % interval of a difference of ratios that were drawn together; None without draws."""
    if not before or not after:
        return None
    draws = [np.array(each, dtype=np.float64) for each in (before, after)]
    return percentile_interval(draws[1] - draws[0])
