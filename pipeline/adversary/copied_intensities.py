"""The intensities of added points, which do not occur twice where those of the sensor never do."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

STEPPED = 0.5
"""With fewer different intensities than this share of a cloud, its sensor states steps."""


def copied_intensities(clean: Float32, source: Int64) -> Float32:
    """Intensities (K,) like those of the points (N,) that added ones start from, by index (K,).

    A copy would be told by its twin: so each lies between its source's value and the next one in the cloud,
    several of one source evenly. Of a sensor that states steps, they are copies.
    """
    values = np.unique(clean)
    copied: Float32 = clean[source]
    if len(values) < max(STEPPED * len(clean), 2):
        return copied
    place = np.searchsorted(values, copied)
    beyond = np.where(place + 1 < len(values), place + 1, place - 1)
    number, count = _numbered(place)
    share = (number + 1) / (count + 1)
    between: Float32 = (copied + share * (values[beyond].astype(np.float64) - copied)).astype(np.float32)
    return between


def _numbered(group: Int64) -> tuple[Int64, Int64]:
    """Of each element (K,), its number within its group, and how many that has."""
    order = np.argsort(group, kind="stable")
    _, first, size = np.unique(group[order], return_index=True, return_counts=True)
    number = np.empty(len(group), np.int64)
    number[order] = np.arange(len(group)) - np.repeat(first, size)
    count = np.empty(len(group), np.int64)
    count[order] = np.repeat(size, size)
    return number, count
