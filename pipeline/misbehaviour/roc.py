"""The ROC curve of a detector's scores, and the area under it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.misbehaviour.scores import Bools

MOST_POINTS = 65
"""Points of a curve that reports keep."""


@dataclass(frozen=True)
class RocCurve:
    """False-positive rates and recalls, from (0, 0) to (1, 1), of messages with scores above a threshold that
    falls from point to point; and the area under the whole curve. Empty, with NaN, where messages are all
    false or all honest."""

    false_positive_rates: tuple[float, ...]
    recalls: tuple[float, ...]
    auc: float

    def thinned(self, most: int = MOST_POINTS) -> RocCurve:
        """At most so many of the points, spread evenly along the curve, with both ends."""
        if len(self.recalls) <= most:
            return self
        flagged, found = np.array(self.false_positive_rates), np.array(self.recalls)
        kept = np.unique(np.searchsorted(flagged + found, np.linspace(0, 2, most)))
        return RocCurve(tuple(flagged[kept].tolist()), tuple(found[kept].tolist()), self.auc)


def roc_curve(scores: Float64, is_false: Bools) -> RocCurve:
    """The curve of M scores (M,), larger for what is less trustworthy.

    Messages of equal score cross the threshold together; in the area, each such pair of a false and an honest
    message counts half.
    """
    false, honest = int(is_false.sum()), int((~is_false).sum())
    if not false or not honest:
        return RocCurve((), (), math.nan)
    order = np.argsort(-scores, kind="stable")
    is_last = np.append(np.diff(scores[order]) != 0, True)
    found = np.concatenate([[0], np.cumsum(is_false[order])[is_last]]) / false
    flagged = np.concatenate([[0], np.cumsum(~is_false[order])[is_last]]) / honest
    auc = float((np.diff(flagged) * (found[1:] + found[:-1]) / 2).sum())
    return RocCurve(tuple(flagged.tolist()), tuple(found.tolist()), auc)
