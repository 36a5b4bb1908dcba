"""How well messages are told apart: counts and the figures made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Scores:
    """Messages by what they are and what was made of them.

    latency_s: from the first lie of each liar that a receiver hears to the first of its lies that is
    flagged, the mean over those that are; caught: the share of liars of whom any lie is flagged.
    """

    true_positives: int
    false_positives: int
    true_negatives: int
    false_negatives: int
    latency_s: float = math.nan
    caught: float = math.nan

    @property
    def precision(self) -> float:
        """TP / (TP + FP); NaN where nothing is flagged."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float:
        """TP / (TP + FN); NaN without lies."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float:
        """2 TP / (2 TP + FP + FN); NaN without lies and flags."""
        errors = self.false_positives + self.false_negatives
        return _ratio(2 * self.true_positives, 2 * self.true_positives + errors)

    @property
    def mcc(self) -> float:
        """Matthews' correlation coefficient; NaN where a row or column of the table is empty."""
        tp, fp, tn, fn = (
            *(self.true_positives, self.false_positives, self.true_negatives, self.false_negatives),
        )
        product = (tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)
        return (tp * tn - fp * fn) / math.sqrt(product) if product else math.nan

    @property
    def false_positive_rate(self) -> float:
        """FP / (FP + TN)."""
        return _ratio(self.false_positives, self.false_positives + self.true_negatives)


def scores(
    flagged: Bools,
    is_lie: Bools,
    liars: npt.NDArray[np.int64] | None = None,
    times_s: npt.NDArray[np.float64] | None = None,
) -> Scores:
    """Of M messages: flags and truth (M,); who truly sent them and when, (M,) each, for the latency.

    liars: any number that tells receiver and sender apart.
    """
    counts = (
        int((flagged & is_lie).sum()),
        int((flagged & ~is_lie).sum()),
        int((~flagged & ~is_lie).sum()),
        int((~flagged & is_lie).sum()),
    )
    if liars is None or times_s is None or not is_lie.any():
        return Scores(*counts)
    delays_s, who = [], np.unique(liars[is_lie])
    for liar in who.tolist():
        own = is_lie & (liars == liar)
        caught = own & flagged
        if caught.any():
            delays_s.append(float(times_s[caught].min() - times_s[own].min()))
    latency_s = float(np.mean(delays_s)) if delays_s else math.nan
    return Scores(*counts, latency_s, len(delays_s) / len(who))


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else math.nan
