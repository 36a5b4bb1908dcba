"""What was done to the points of one cloud."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Bool = npt.NDArray[np.bool_]

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
    attacked: (K,) int64, index in the adversarial cloud, -1 for a removed point. None where the points that
    were not removed keep their order and those added follow them.
    """

    point: npt.NDArray[np.int64]
    action: npt.NDArray[np.str_]
    displacement_m: npt.NDArray[np.float64]
    attacked: npt.NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.point)

    @cached_property
    def is_removed(self) -> Bool:
        """Which of them (K,) were removed."""
        return self._are(REMOVED)

    @cached_property
    def is_moved(self) -> Bool:
        """Which of them (K,) were moved."""
        return self._are(MOVED)

    @cached_property
    def is_added(self) -> Bool:
        """Which of them (K,) were added."""
        return self._are(ADDED)

    def _are(self, action: str) -> Bool:
        same: Bool = self.action == action
        return same

    def places(self, points: int) -> npt.NDArray[np.int64]:
        """The index (K,) of each touched point in the adversarial cloud, -1 for a removed one; points: of the
        clean cloud."""
        if self.attacked is not None:
            return self.attacked
        is_removed, is_added = self.is_removed, self.is_added
        if not (is_removed.any() or is_added.any()):
            return self.point.astype(np.int64, copy=False)
        kept = np.ones(points, bool)
        kept[self.point[is_removed]] = False
        place = np.cumsum(kept) - 1
        found = np.full(len(self), -1, np.int64)
        is_moved = ~(is_removed | is_added)
        found[is_moved] = place[self.point[is_moved]]
        found[is_added] = kept.sum() + np.arange(is_added.sum())
        return found

    @staticmethod
    def removed(points: npt.NDArray[np.int64]) -> PointLabels:
        """Labels of removed points (K,)."""
        return PointLabels(np.sort(points), np.full(len(points), REMOVED), np.full(len(points), np.nan))
