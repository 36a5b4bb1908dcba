"""Average precision of 3D detections, after KITTI with 40 recall positions (R40) or 11 (R11)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.matching import FrameMatches, MatchTable, match_frame

__all__ = [
    "LOOSE_IOU",
    "R11",
    "R40",
    "STRICT_IOU",
    "FrameMatches",
    "RankedMatches",
    "RecallPositions",
    "average_precision",
    "match_frame",
    "mean_average_precision",
]

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

STRICT_IOU: Mapping[str, float] = {"car": 0.7, "truck": 0.7, "cyclist": 0.5, "pedestrian": 0.5}
"""KITTI's strict overlaps; `truck` takes that of `car`."""

LOOSE_IOU: Mapping[str, float] = {"car": 0.5, "truck": 0.5, "cyclist": 0.25, "pedestrian": 0.25}
"""KITTI's loose overlaps."""

_CHUNK = 1 << 20


@dataclass(frozen=True)
class RecallPositions:
    """The recalls at which precision is read: 1/steps, 2/steps, ... 1, and with `with_zero` also 0."""

    steps: int
    with_zero: bool = False

    @property
    def count(self) -> int:
        """The number of recall positions."""
        return self.steps + self.with_zero


R40 = RecallPositions(40)
"""40 recall positions (Simonelli et al., ICCV 2019), by which KITTI has ranked since 2019."""

R11 = RecallPositions(10, with_zero=True)
"""11 recall positions: PASCAL VOC 2007 (Everingham et al., IJCV 2010, section 4.2) and KITTI before 2019."""


@dataclass(frozen=True)
class RankedMatches:
    """The matches of one class in F frames, sorted once by score.

    scores, is_true_positive: (D,), for the detections that are not ignored, best first.
    frame: (D,) int64, the frame of each detection.
    n_truth: (F,) int64, number of evaluated ground-truth objects in each frame.
    """

    scores: Float64
    is_true_positive: Bool
    frame: Int64
    n_truth: Int64

    @classmethod
    def of(cls, frames: Sequence[FrameMatches] | MatchTable) -> RankedMatches:
        """Sort the matches of one class in several frames."""
        table = frames if isinstance(frames, MatchTable) else MatchTable.of(frames)
        counted = np.flatnonzero(~table.matches.is_ignored)
        order = counted[np.argsort(-table.matches.scores[counted], kind="stable")]
        return cls(
            table.matches.scores[order],
            table.matches.is_true_positive[order],
            table.detection_frame[order],
            np.bincount(table.truth_frame[table.matches.is_evaluated], minlength=table.n_frames),
        )

    @cached_property
    def _threshold(self) -> Int64:
        """(G,) the last detection of each group of equal scores, since no threshold divides a group."""
        return np.flatnonzero(np.append(self.scores[1:] != self.scores[:-1], True)[: len(self.scores)])

    def curve(self) -> tuple[Int64, Int64, int]:
        """True positives (G,) and detections (G,) at each score threshold, and the number of objects."""
        found = np.cumsum(self.is_true_positive, dtype=np.int64)[self._threshold]
        return found, self._threshold + 1, int(self.n_truth.sum())

    def precision_recall(self) -> tuple[Float64, Float64]:
        """Recall and precision (G,) at each score threshold, from the highest score down."""
        found, detected, n_truth = self.curve()
        return found / max(n_truth, 1), found / detected

    def average_precision(self, weights: Int64 | None = None, positions: RecallPositions = R40) -> float:
        """Average precision in [0, 1]; NaN if there are no ground-truth objects.

        weights: (F,), how often each frame is counted; by default once.

        It is the mean, over the recall positions, of the highest precision at that recall or a higher one
        (Simonelli et al., ICCV 2019, Eq. 7). Precision is computed at every score, while KITTI's program
        samples the scores.
        """
        frames = len(self.n_truth)
        if weights is None:
            return float(self.average_precisions(np.ones((1, 1)), np.zeros(frames, np.int64), positions)[0])
        return float(self.average_precisions(weights[None], np.arange(frames), positions)[0])

    def average_precisions(
        self, times: npt.ArrayLike, block: Int64, positions: RecallPositions = R40
    ) -> Float64:
        """The average precision (W,) of each of W draws of the frames.

        times: (W, B), how often each draw contains each block of frames. block: (F,), the frame's block.
        """
        times = np.asarray(times, dtype=np.float64)
        found, detected = self._by_block(block, times.shape[1])
        n_truth: Float64 = times @ np.bincount(block, self.n_truth, minlength=times.shape[1])
        step = max(1, _CHUNK // max(len(found), 1))
        parts = [
            _interpolated(times[s : s + step] @ found.T, times[s : s + step] @ detected.T,
                          n_truth[s : s + step], positions)
            for s in range(0, len(times), step)
        ]  # fmt: skip
        return np.concatenate([np.zeros(0), *parts])

    def _by_block(self, block: Int64, n_blocks: int) -> tuple[Float64, Float64]:
        """True positives and detections (T, B) of each block down to each threshold with a new true positive.

        Between these thresholds precision only falls. Sums of whole numbers are exact in any order, so the
        result does not depend on the number of threads.
        """
        found = np.cumsum(self.is_true_positive)[self._threshold]
        useful = self._threshold[np.diff(found, prepend=0) > 0]
        segment = np.searchsorted(useful, np.arange(len(self.scores)))
        cell = segment * n_blocks + block[self.frame]
        shape = (len(useful) + 1, n_blocks)  # detections after the last true positive are dropped
        detected = np.bincount(cell, minlength=shape[0] * n_blocks).reshape(shape)[:-1]
        hits = np.bincount(cell, self.is_true_positive, minlength=shape[0] * n_blocks).reshape(shape)[:-1]
        return np.cumsum(hits, axis=0, dtype=np.float64), np.cumsum(detected, axis=0, dtype=np.float64)

    def best_f1_score(self) -> float:
        """The score threshold with the best F1, a natural operating point; 0 without detections.

        It is half-way between the lowest score that is kept and the next lower one (or 0).
        """
        found, detected, n_truth = self.curve()
        if not len(found):
            return 0.0
        levels = np.append(self.scores[self._threshold], 0.0)
        best = int(np.argmax(2 * found / np.maximum(detected + n_truth, 1)))
        return float(levels[best : best + 2].mean())


def _interpolated(found: Float64, detected: Float64, n_truth: Float64, positions: RecallPositions) -> Float64:
    """Average precision (W,) from true positives and detections (W, T) at falling thresholds."""
    if not found.shape[1]:
        return np.where(n_truth > 0, 0.0, np.nan)
    precision = found / np.maximum(detected, 1)
    envelope = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
    # A quotient of whole numbers is exact if it is whole, so rounding never misses a recall position.
    reached = np.floor(found * positions.steps / np.maximum(n_truth, 1)[:, None]) + positions.with_zero
    total = (np.diff(reached, axis=1, prepend=0) * envelope).sum(axis=1)
    return np.where(n_truth > 0, total / positions.count, np.nan)


def average_precision(frames: Sequence[FrameMatches]) -> float:
    """R40 average precision of one class over frames; see `RankedMatches.average_precision`."""
    return RankedMatches.of(frames).average_precision()


def mean_average_precision(values: npt.ArrayLike) -> Float64:
    """The mean of average precisions (C, ...) over the classes, the first axis.

    Classes without ground-truth objects (NaN) are left out; NaN if all are.
    """
    array = np.asarray(values, dtype=np.float64)
    defined = np.isfinite(array)
    count = defined.sum(axis=0)
    total = np.where(defined, array, 0.0).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
