"""The matches of one frame by every criterion and class, kept in few arrays: a long drive has many frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.metrics.matching import FrameMatches

Bool = npt.NDArray[np.bool_]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]


def labelled(labels: Int64, name: str) -> Bool:
    """Which of the boxes with these labels (M,) are of a class."""
    mine: Bool = labels == CLASSES.index(name)
    return mine


@dataclass(frozen=True, slots=True, eq=False)
class Matches(Mapping[tuple[str, str], FrameMatches]):
    """K detections and M objects of one frame, matched by C criteria; read by criterion and class.

    Each pair has five small arrays, of which numpy's own headers are the larger part; so they are made when
    asked for, from one array for all pairs.

    object_labels, is_evaluated: (M,). labels, scores: (K,), of the detections. found_by: (C, M), the
    detection among all K that each object was matched to, -1 for none. is_ignored: (C, K); so are detections
    of other classes.
    """

    criteria: tuple[str, ...]
    classes: tuple[str, ...]
    object_labels: Int64
    is_evaluated: Bool
    labels: Int64
    scores: Float64
    found_by: Int32
    is_ignored: Bool

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return ((criterion, name) for name in self.classes for criterion in self.criteria)

    def __len__(self) -> int:
        return len(self.classes) * len(self.criteria)

    def __getitem__(self, pair: tuple[str, str]) -> FrameMatches:
        criterion, name = pair
        if criterion not in self.criteria or name not in self.classes:
            raise KeyError(pair)
        row = self.criteria.index(criterion)
        mine, theirs = labelled(self.object_labels, name), labelled(self.labels, name)
        found_by = self.found_by[row, mine]
        place = np.append(np.cumsum(theirs) - 1, -1)  # among those of the class
        return FrameMatches(
            self.scores[theirs],
            self.is_true_positive(criterion)[theirs],
            self.is_ignored[row, theirs],
            place[found_by],
            self.is_evaluated[mine],
        )

    def of_all_classes(self, criterion: str) -> FrameMatches:
        """The matches by one criterion, of all classes together."""
        row = self.criteria.index(criterion)
        return FrameMatches(
            self.scores,
            self.is_true_positive(criterion),
            self.is_ignored[row],
            self.found_by[row].astype(np.int64),
            self.is_evaluated,
        )

    def is_true_positive(self, criterion: str) -> Bool:
        """Which detections (K,) find an evaluated object."""
        found_by = self.found_by[self.criteria.index(criterion)]
        hit = np.zeros(len(self.scores), dtype=bool)
        hit[found_by[self.is_evaluated & (found_by >= 0)]] = True
        return hit
