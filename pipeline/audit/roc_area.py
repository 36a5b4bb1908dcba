"""The area under a ROC curve with an interval that respects that units of one moment or drive are alike."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


FEWEST = 3
"""Clusters with attacked units, and with clean ones, of which an interval can tell anything."""


@dataclass(frozen=True)
class RocArea:
    """The probability that an attacked unit scores higher than a clean one, ties counting half.

    low, high: the interval; NaN where the area rests on fewer than `FEWEST` clusters. attacked, clean,
    clusters: how many there are.
    """

    area: float
    low: float
    high: float
    attacked: int
    clean: int
    clusters: int

    @property
    def reversed(self) -> RocArea:
        """The same where a lower score is the more suspicious one."""
        return replace(self, area=1 - self.area, low=1 - self.high, high=1 - self.low)


def roc_area(scores: Float64, is_attacked: Bool, cluster: Int64, tests: int = 1) -> RocArea:
    """The area of scores (N,) of units, its interval at 95 % over `tests` probes together (Bonferroni).

    cluster: (N,) the units of one cluster are not independent. The interval is Student's for the jackknife's
    pseudo-values, one for each cluster that is left out in turn (Tukey 1958), with two more of 0 and 1: a few
    clusters that a probe happens to tell apart do not make it certain (cf. Agresti and Coull 1998).
    """
    from scipy.stats import t

    attacked, clean = scores[is_attacked], scores[~is_attacked]
    names = np.unique(cluster)
    if not (len(attacked) and len(clean)):
        return RocArea(math.nan, math.nan, math.nan, len(attacked), len(clean), len(names))
    ours, theirs = (np.searchsorted(names, cluster[which]) for which in (is_attacked, ~is_attacked))
    wins = _wins(attacked, ours, clean, theirs, len(names))
    pairs = np.outer(np.bincount(ours, minlength=len(names)), np.bincount(theirs, minlength=len(names)))
    area = float(wins.sum() / pairs.sum())
    left_wins, left_pairs = (
        each.sum() - each.sum(axis=0) - each.sum(axis=1) + np.diag(each) for each in (wins, pairs)
    )
    count = len(names)
    fewest = min(len(np.unique(each)) for each in (ours, theirs))
    if fewest < FEWEST or (left_pairs <= 0).any():  # the area rests on few clusters
        return RocArea(area, math.nan, math.nan, len(attacked), len(clean), len(names))
    pseudo = count * area - (count - 1) * left_wins / left_pairs
    values = np.concatenate([pseudo, [0.0, 1.0]])
    reach = float(
        t.ppf(1 - 0.025 / max(tests, 1), len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    )
    centre = float(values.mean())
    low, high = max(0.0, min(area, centre - reach)), min(1.0, max(area, centre + reach))
    return RocArea(area, low, high, len(attacked), len(clean), len(names))


def _wins(attacked: Float64, ours: Int64, clean: Float64, theirs: Int64, clusters: int) -> Float64:
    """In how many pairs of an attacked unit of one cluster (rows) and a clean one of another (columns) the
    attacked one scores higher, ties counting half."""
    wins = np.zeros((clusters, clusters))
    for column in np.unique(theirs):
        others = np.sort(clean[theirs == column])
        above = np.searchsorted(others, attacked, "left") + np.searchsorted(others, attacked, "right")
        wins[:, column] = np.bincount(ours, above / 2, clusters)
    return wins
