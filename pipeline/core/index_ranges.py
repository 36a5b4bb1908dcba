"""Ranges of indices of different lengths, one after the other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Int64 = npt.NDArray[np.int64]


def index_ranges(starts: Int64, counts: Int64) -> Int64:
    """The integers from each start (N,) on, as many as its count (N,), in one array (counts.sum(),).

    `np.repeat(np.arange(N), counts)` says which range each of them is of.
    """
    indices: Int64 = np.repeat(starts - (np.cumsum(counts) - counts), counts)
    indices += np.arange(len(indices))
    return indices
