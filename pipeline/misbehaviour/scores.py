"""How well a detector separates false messages from honest ones: counts and derived metrics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Scores:
    """The confusion matrix of messages, and how soon attackers are detected.

    latency_s: from an attacker's first false message at a receiver to its first flagged one, the mean
    over the detected attackers; caught: the share of attackers with any flagged false message. innocent: the
    messages of stations that do not attack; innocent_flagged: those of them that are flagged. The other false
    positives are true messages of attackers.
    """

    true_positives: int
    false_positives: int
    true_negatives: int
    false_negatives: int
    latency_s: float = math.nan
    caught: float = math.nan
    innocent: int = 0
    innocent_flagged: int = 0

    @property
    def precision(self) -> float:
        """TP / (TP + FP); NaN where nothing is flagged."""
        return _ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float:
        """TP / (TP + FN); NaN without false messages."""
        return _ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float:
        """2 TP / (2 TP + FP + FN); NaN without false and flagged messages."""
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

    @property
    def innocent_false_positive_rate(self) -> float:
        """The share of the messages of stations that do not attack that are flagged."""
        return _ratio(self.innocent_flagged, self.innocent)


def scores(
    flagged: Bools,
    is_false: Bools,
    senders: npt.NDArray[np.int64] | None = None,
    times_s: npt.NDArray[np.float64] | None = None,
    is_attackers: Bools | None = None,
) -> Scores:
    """Score M messages from flags and truth (M,); for the latency, from true senders and times (M,) too.

    senders: a number for each pair of receiver and sender. is_attackers: (M,), whether a station that attacks
    sent the message, true or false; by default nobody attacks but who sends false messages.
    """
    counts = (
        int((flagged & is_false).sum()),
        int((flagged & ~is_false).sum()),
        int((~flagged & ~is_false).sum()),
        int((~flagged & is_false).sum()),
    )
    innocent = ~is_false if is_attackers is None else ~is_false & ~is_attackers
    innocents = int(innocent.sum()), int((flagged & innocent).sum())
    if senders is None or times_s is None or not is_false.any():
        return Scores(*counts, math.nan, math.nan, *innocents)
    delays_s, attackers = [], np.unique(senders[is_false])
    for attacker in attackers.tolist():
        own = is_false & (senders == attacker)
        caught = own & flagged
        if caught.any():
            delays_s.append(float(times_s[caught].min() - times_s[own].min()))
    latency_s = float(np.mean(delays_s)) if delays_s else math.nan
    return Scores(*counts, latency_s, len(delays_s) / len(attackers), *innocents)


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else math.nan
