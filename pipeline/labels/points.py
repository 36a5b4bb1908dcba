"""What was done to the points of one cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

MOVED, ADDED, REMOVED = "moved", "added", "removed"
ACTIONS = (REMOVED, MOVED, ADDED)
"""Moved: the point has other coordinates or another intensity. Added: the clean cloud does not have it.
Removed: the adversarial cloud does not have it."""


@dataclass(frozen=True)
class PointLabels:
    """What was done to the K touched points of one cloud.

    point: (K,) int64, index in the clean cloud, ascending; -1 for an added point.
    action: (K,) str, what was done to it, one of `ACTIONS`.
    displacement_m: (K,) float64, how far it was moved, or the distance of an added point to the nearest clean
    point; NaN for a removed point.
    """

    point: npt.NDArray[np.int64]
    action: npt.NDArray[np.str_]
    displacement_m: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.point)

    @staticmethod
    def removed(points: npt.NDArray[np.int64]) -> PointLabels:
        """Labels of removed points (K,)."""
        return PointLabels(np.sort(points), np.full(len(points), REMOVED), np.full(len(points), np.nan))
