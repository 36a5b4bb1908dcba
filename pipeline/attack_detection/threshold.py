"""Thresholds on the scores of checks, calibrated on clean clouds, and how well scores tell clouds apart."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata

Float64 = npt.NDArray[np.float64]


def calibrated_threshold(clean: Float64, false_positive_rate: float) -> float:
    """The threshold that at most this share of clean scores (N,) exceeds, of those in the long run, too.

    It is the smallest of the scores such that a further clean one, of the same distribution, exceeds it with
    at most that probability (split conformal prediction); with fewer than 1 / rate - 1 scores there is none,
    and the largest score is taken, which a further one exceeds with a probability of up to 1 / (N + 1).
    Infinite without any score.
    """
    if not len(clean):
        return math.inf
    rank = min(math.ceil((len(clean) + 1) * (1 - false_positive_rate)), len(clean))
    return float(np.sort(clean)[rank - 1])


def area_under_roc(clean: Float64, attacked: Float64) -> float:
    """The probability that an attacked score (M,) exceeds a clean one (N,), ties counting half; NaN without
    scores of both."""
    if not (len(clean) and len(attacked)):
        return math.nan
    ranks = rankdata(np.concatenate([clean, attacked]))[len(clean) :]
    above = ranks.sum() - len(attacked) * (len(attacked) + 1) / 2
    return float(above / (len(clean) * len(attacked)))
