"""How suspicious a probe's value is, learnt on other drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.probe import Float64
from advpipe.pipeline.audit.roc_area import Bool

BINS = 32
"""Quantile bins of a probe's values."""

MIN_UNITS = 5
"""Attacked and clean units, each, from which a probe learns."""


@dataclass(frozen=True)
class ProbeModel:
    """The logarithm of how much more often attacked units have a value than clean ones, bin by bin.

    edges: (B - 1,) between the B bins, ascending. scores: (B + 1,), the last for values that are not there.
    """

    edges: Float64
    scores: Float64

    @classmethod
    def learnt(cls, values: Float64, is_attacked: Bool) -> ProbeModel | None:
        """From units (N,) of other drives; None with too few of them. Bins of a few units say little: each
        count is raised by one half (Krichevsky and Trofimov 1981)."""
        attacked, clean = values[is_attacked], values[~is_attacked]
        if min(len(attacked), len(clean)) < MIN_UNITS:
            return None
        known = [each[np.isfinite(each)] for each in (attacked, clean)]
        levels = np.linspace(0, 1, BINS // 2 + 1)
        quantiles = [np.quantile(each, levels) for each in known if len(each)]
        edges = np.unique(np.concatenate([np.zeros(0), *quantiles]))[1:]
        counts = [
            np.bincount(_bins(edges, each), minlength=len(edges) + 2) + 0.5 for each in (attacked, clean)
        ]
        shares = [count / count.sum() for count in counts]
        return cls(edges, np.log(shares[0] / shares[1]))

    def __call__(self, values: Float64) -> Float64:
        """The scores of units (N,)."""
        found: Float64 = self.scores[_bins(self.edges, values)]
        return found


def untrained(values: Float64) -> Float64:
    """The values as scores; one that is not there comes last."""
    return np.where(np.isfinite(values), values, -np.inf)


def _bins(edges: Float64, values: Float64) -> npt.NDArray[np.int64]:
    places: npt.NDArray[np.int64] = np.searchsorted(edges, values, "right")
    return np.where(np.isnan(values), len(edges) + 1, places)
