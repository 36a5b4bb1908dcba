"""Which detection finds which object: greedy by descending score, as KITTI and PASCAL VOC match.

A frame and a class are matched once. The matching does not depend on a score threshold, so the average
precision of any collection of frames, such as a bootstrap draw, follows from the stored matches; and
that of a part of the objects, such as the near ones, from `MatchTable.within`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.iou import iou_3d

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


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

    @property
    def finds(self) -> Int64:
        """The ground truth (K,) that each detection was matched to, -1 for none."""
        finds = np.full(len(self.scores), -1, dtype=np.int64)
        matched = np.flatnonzero(self.found_by >= 0)
        finds[self.found_by[matched]] = matched
        return finds

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
    """Match the detections (K, 7) of one class with the ground truth (M, 7) of one frame."""
    return match_overlaps(iou(detections, truth), is_evaluated, scores, min_iou)


def match_overlaps(overlap: Float64, is_evaluated: Bool, scores: Float64, min_iou: float) -> FrameMatches:
    """Match detections with ground truth that they overlap by (K, M).

    The best score chooses first, equal scores in the order given. A detection takes the free
    ground truth of the highest overlap, if that is at least `min_iou`, and rather an evaluated one
    than an ignored one. Each ground truth is taken once, so a second detection of it is a false
    positive.
    """
    found_by = np.full(overlap.shape[1], -1, dtype=np.int64)
    is_true_positive = np.zeros(len(overlap), dtype=bool)
    is_ignored = np.zeros(len(overlap), dtype=bool)
    near: Bool = np.any(overlap >= min_iou, axis=1)
    for k in np.argsort(-scores, kind="stable"):
        if not near[k]:
            continue
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
class MatchTable:
    """The matches of one class in F frames, one frame after the other.

    matches: of all K detections and M objects, as if they were of one frame.
    detection_frame, truth_frame: (K,) and (M,) int64, the frame of each.
    """

    matches: FrameMatches
    detection_frame: Int64
    truth_frame: Int64
    n_frames: int

    @classmethod
    def of(cls, frames: Sequence[FrameMatches]) -> MatchTable:
        n_detections = np.array([len(frame.scores) for frame in frames], dtype=np.int64)
        n_truths = np.array([len(frame.found_by) for frame in frames], dtype=np.int64)
        truth_frame = np.repeat(np.arange(len(frames)), n_truths)
        found_by = np.concatenate([np.zeros(0, np.int64), *(frame.found_by for frame in frames)])
        first = np.cumsum(n_detections) - n_detections
        return cls(
            FrameMatches(
                np.concatenate([np.zeros(0), *(frame.scores for frame in frames)]),
                _joined([frame.is_true_positive for frame in frames]),
                _joined([frame.is_ignored for frame in frames]),
                np.where(found_by >= 0, found_by + first[truth_frame], -1),
                _joined([frame.is_evaluated for frame in frames]),
            ),
            np.repeat(np.arange(len(frames)), n_detections),
            truth_frame,
            len(frames),
        )

    def within(self, truths: Bool, detections: Bool) -> MatchTable:
        """The same matches where only some objects (M,) are evaluated, such as the near ones.

        What finds another object counts no more, and what finds nothing only if it is one of
        `detections` (K,), such as the near ones.
        """
        matches, finds = self.matches, self.matches.finds
        is_evaluated = matches.is_evaluated & truths
        finds_evaluated = (finds >= 0) & np.append(is_evaluated, False)[finds]
        is_ignored = np.where(finds >= 0, ~finds_evaluated, matches.is_ignored | ~detections)
        chosen = replace(
            matches,
            is_true_positive=matches.is_true_positive & finds_evaluated,
            is_ignored=is_ignored,
            is_evaluated=is_evaluated,
        )
        return replace(self, matches=chosen)


def _joined(masks: Sequence[Bool]) -> Bool:
    return np.concatenate([np.zeros(0, bool), *masks])
