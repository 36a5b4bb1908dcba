"""Average precision of 3D detections, after KITTI with 40 recall positions (R40) or 11 (R11)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

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

_FEW_BLOCKS = 64
"""Up to so many blocks, each draw adds up the counts of blocks; of more, of detections: a long drive has
many thresholds and many blocks, and their product would grow with its square."""


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
        n_truth: Float64 = times @ np.bincount(block, self.n_truth, minlength=times.shape[1])
        is_few = times.shape[1] <= _FEW_BLOCKS
        counts = self._counts_by_block(block, times.shape[1]) if is_few else partial(self._counts, block)
        step = max(1, _CHUNK // max(len(self._useful) if is_few else len(self.scores), 1))
        parts = [
            _interpolated(*counts(times[s : s + step]), n_truth[s : s + step], positions)
            for s in range(0, len(times), step)
        ]
        return np.concatenate([np.zeros(0), *parts])

    @cached_property
    def _useful(self) -> Int64:
        """(T,) the thresholds with a new true positive: between them precision only falls."""
        found = np.cumsum(self.is_true_positive)[self._threshold]
        return self._threshold[np.diff(found, prepend=0) > 0]

    def _counts(self, block: Int64, times: Float64) -> tuple[Float64, Float64]:
        """True positives and detections (W, T) down to each of the useful thresholds, in each of W draws.

        Sums of whole numbers are exact in any order, so the result does not depend on the number of threads.
        """
        weights = times[:, block[self.frame]]
        both = (np.cumsum(each, axis=1) for each in (weights * self.is_true_positive, weights))
        found, detected = (np.take(each, self._useful, axis=1) for each in both)  # row by row, as sums go
        return found, detected

    def _counts_by_block(self, block: Int64, n_blocks: int) -> Callable[[Float64], tuple[Float64, Float64]]:
        """The same function of W draws, from the counts of each block."""
        segment = np.searchsorted(self._useful, np.arange(len(self.scores)))
        cell = segment * n_blocks + block[self.frame]
        shape = (len(self._useful) + 1, n_blocks)  # detections after the last true positive are dropped
        cells = shape[0] * n_blocks
        detected = np.bincount(cell, minlength=cells).reshape(shape)[:-1]
        hits = np.bincount(cell, self.is_true_positive, minlength=cells).reshape(shape)[:-1]
        found, seen = (np.cumsum(each, axis=0, dtype=np.float64) for each in (hits, detected))
        return lambda times: (times @ found.T, times @ seen.T)

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
