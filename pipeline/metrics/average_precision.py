"""Average precision of 3D detections, after KITTI with 40 recall positions (R40).

A frame and a class are matched once (`match_frame`). The matching is greedy by descending score, so
it does not depend on a score threshold, and the average precision of any collection of frames, such
as a bootstrap draw, follows from the stored matches (`RankedMatches`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.iou import iou_3d

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

STRICT_IOU: Mapping[str, float] = {"car": 0.7, "truck": 0.7, "cyclist": 0.5, "pedestrian": 0.5}
"""KITTI's strict overlaps; `truck` takes that of `car`."""

LOOSE_IOU: Mapping[str, float] = {"car": 0.5, "truck": 0.5, "cyclist": 0.25, "pedestrian": 0.25}
"""KITTI's loose overlaps."""

RECALL_POSITIONS = 40


@dataclass(frozen=True)
class FrameMatches:
    """What became of the detections and the ground truth of one class in one frame.

    scores: (K,) float64, one a detection.
    is_true_positive, is_ignored: (K,) bool; a detection that is neither is a false positive.
    found_by: (M,) int64, the detection that a ground truth was matched to, -1 for none.
    is_evaluated: (M,) bool; ground truth that is not evaluated counts for nothing.
    """

    scores: Float64
    is_true_positive: Bool
    is_ignored: Bool
    found_by: Int64
    is_evaluated: Bool

    @property
    def n_truth(self) -> int:
        return int(self.is_evaluated.sum())

    def found(self, min_score: float = 0.0) -> Bool:
        """Which of the ground truth (M,) is evaluated and found with at least this score."""
        hit = self.is_evaluated & (self.found_by >= 0)
        hit[hit] = self.scores[self.found_by[hit]] >= min_score
        return hit

    def is_false_positive(self, min_score: float = 0.0) -> Bool:
        """Which of the detections (K,) have at least this score and find nothing."""
        return ~self.is_true_positive & ~self.is_ignored & (self.scores >= min_score)


def match_frame(
    truth: Float64,
    is_evaluated: Bool,
    detections: Float64,
    scores: Float64,
    min_iou: float,
    iou: Callable[[Float64, Float64], Float64] = iou_3d,
) -> FrameMatches:
    """Match the detections (K, 7) of one class with the ground truth (M, 7) of one frame.

    The best score chooses first, equal scores in the order given. A detection takes the free
    ground truth of the highest overlap, if that is at least `min_iou`, and rather an evaluated one
    than an ignored one. Each ground truth is taken once, so a second detection of it is a false
    positive.
    """
    found_by = np.full(len(truth), -1, dtype=np.int64)
    is_true_positive = np.zeros(len(detections), dtype=bool)
    is_ignored = np.zeros(len(detections), dtype=bool)
    if len(truth) and len(detections):
        overlap = iou(detections, truth)
        for k in np.argsort(-scores, kind="stable"):
            free = (found_by < 0) & (overlap[k] >= min_iou)
            for mine, fate in ((free & is_evaluated, is_true_positive), (free & ~is_evaluated, is_ignored)):
                if mine.any():
                    found_by[np.argmax(np.where(mine, overlap[k], -1.0))] = k
                    fate[k] = True
                    break
    return FrameMatches(
        np.asarray(scores, np.float64), is_true_positive, is_ignored, found_by, np.asarray(is_evaluated, bool)
    )


@dataclass(frozen=True)
class RankedMatches:
    """The matches of one class in F frames, sorted once by score.

    scores, is_true_positive: (D,) of the detections that count, best first.
    frame: (D,) int64, the frame of each.
    n_truth: (F,) int64, how many objects there are to find.
    """

    scores: Float64
    is_true_positive: Bool
    frame: Int64
    n_truth: Int64

    @classmethod
    def of(cls, frames: Sequence[FrameMatches]) -> RankedMatches:
        counted = [~m.is_ignored for m in frames]
        scores = np.concatenate([m.scores[c] for m, c in zip(frames, counted, strict=True)] or [np.zeros(0)])
        hits = [m.is_true_positive[c] for m, c in zip(frames, counted, strict=True)]
        is_true_positive = np.concatenate(hits or [np.zeros(0, bool)])
        frame = np.repeat(np.arange(len(frames)), [len(h) for h in hits])
        order = np.argsort(-scores, kind="stable")
        n_truth = np.array([m.n_truth for m in frames], dtype=np.int64)
        return cls(scores[order], is_true_positive[order], frame[order], n_truth)

    @cached_property
    def _threshold(self) -> Int64:
        """(G,) the last detection of each group of equal scores: no threshold cuts a group."""
        return np.flatnonzero(np.append(self.scores[1:] != self.scores[:-1], True)[: len(self.scores)])

    def curve(self, weights: Int64 | None = None) -> tuple[Int64, Int64, int]:
        """True positives (G,) and detections (G,) at each score threshold, and the objects to find.

        weights: (F,) how often each frame counts; once if not given.
        """
        if weights is None:
            weights = np.ones(len(self.n_truth), dtype=np.int64)
        each = weights[self.frame]
        detected = np.cumsum(each)[self._threshold]
        found = np.cumsum(each * self.is_true_positive)[self._threshold]
        return found, detected, int(weights @ self.n_truth)

    def average_precision(self, weights: Int64 | None = None) -> float:
        """R40 average precision in [0, 1]; NaN if there is nothing to find.

        The mean, over the recalls 1/40, 2/40, ... 1, of the best precision at that recall or a
        higher one (Simonelli et al., ICCV 2019, Eq. 7; precision is taken at every score, where
        KITTI's own program samples it).
        """
        found, detected, n_truth = self.curve(weights)
        if n_truth == 0:
            return float("nan")
        precision = found / np.maximum(detected, 1)
        envelope = np.append(np.maximum.accumulate(precision[::-1])[::-1], 0.0)
        position = np.arange(1, RECALL_POSITIONS + 1)
        reached = np.searchsorted(found * RECALL_POSITIONS, position * n_truth)  # exact in integers
        return float(envelope[reached].mean())

    def best_f1_score(self) -> float:
        """The score threshold with the best F1, a natural working point; 0 without detections.

        Half-way between the lowest score that is kept and the next one, or 0.
        """
        found, detected, n_truth = self.curve()
        if not len(found):
            return 0.0
        levels = np.append(self.scores[self._threshold], 0.0)
        best = int(np.argmax(2 * found / np.maximum(detected + n_truth, 1)))
        return float(levels[best : best + 2].mean())


def average_precision(frames: Sequence[FrameMatches]) -> float:
    """R40 average precision of one class over frames; see `RankedMatches.average_precision`."""
    return RankedMatches.of(frames).average_precision()


def mean_average_precision(ranked: Sequence[RankedMatches], weights: Int64 | None = None) -> float:
    """The mean over classes; a class with nothing to find in these frames is left out."""
    values = [r.average_precision(weights) for r in ranked]
    defined = [v for v in values if not np.isnan(v)]
    return float(np.mean(defined)) if defined else float("nan")
