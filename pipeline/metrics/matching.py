"""Matches detections with ground truth: greedily by descending score, as KITTI and PASCAL VOC do.

A frame and a class are matched once. The matching does not depend on a score threshold, so the average
precision of any selection of frames, such as a bootstrap draw, follows from the stored matches. For a
selection of objects, such as near ones, use `MatchTable.within`.
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
    """The matches of K detections with M ground-truth objects of one class in one frame.

    scores: (K,) float64, the score of each detection.
    is_true_positive, is_ignored: (K,) bool; a detection that is neither is a false positive.
    found_by: (M,) int64, the detection that each object was matched to, -1 for none.
    is_evaluated: (M,) bool; objects that are not evaluated are neither found nor missed.
    """

    scores: Float64
    is_true_positive: Bool
    is_ignored: Bool
    found_by: Int64
    is_evaluated: Bool

    @property
    def n_truth(self) -> int:
        """The number of evaluated objects."""
        return int(self.is_evaluated.sum())

    @property
    def finds(self) -> Int64:
        """The object (K,) that each detection was matched to, -1 for none."""
        finds = np.full(len(self.scores), -1, dtype=np.int64)
        matched = np.flatnonzero(self.found_by >= 0)
        finds[self.found_by[matched]] = matched
        return finds

    def found(self, min_score: float = 0.0) -> Bool:
        """Which objects (M,) are evaluated and found with at least this score."""
        hit = self.is_evaluated & (self.found_by >= 0)
        hit[hit] = self.scores[self.found_by[hit]] >= min_score
        return hit

    def ignoring(self, detections: Bool) -> FrameMatches:
        """The same matches with those of the detections (K,) ignored that find no evaluated object."""
        return replace(self, is_ignored=self.is_ignored | (detections & ~self.is_true_positive))

    def is_false_positive(self, min_score: float = 0.0) -> Bool:
        """Which detections (K,) are false positives with at least this score."""
        return ~self.is_true_positive & ~self.is_ignored & (self.scores >= min_score)


def match_frame(
    truth: Float64,
    is_evaluated: Bool,
    detections: Float64,
    scores: Float64,
    min_iou: float,
    iou: Callable[[Float64, Float64], Float64] = iou_3d,
) -> FrameMatches:
    """Match detections (K, 7) with ground-truth boxes (M, 7) of one class in one frame.

    is_evaluated: (M,) bool. scores: (K,). min_iou: overlap from which a detection matches an object. iou:
    computes the overlaps (K, M).
    """
    return match_overlaps(iou(detections, truth), is_evaluated, scores, min_iou)


def match_overlaps(overlap: Float64, is_evaluated: Bool, scores: Float64, min_iou: float) -> FrameMatches:
    """Match K detections with M ground-truth objects by their overlaps (K, M).

    Detections are matched by descending score, and in the given order at equal scores. Each takes the object
    with the highest overlap among those that are not yet matched and overlap by at least `min_iou`; evaluated
    objects take precedence over others. Each object is matched once, so a second detection of it is a false
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
        for candidates, outcome in (
            (free & is_evaluated, is_true_positive),
            (free & ~is_evaluated, is_ignored),
        ):
            if candidates.any():
                found_by[np.argmax(np.where(candidates, overlap[k], -1.0))] = k
                outcome[k] = True
                break
    return FrameMatches(
        np.asarray(scores, np.float64), is_true_positive, is_ignored, found_by, np.asarray(is_evaluated, bool)
    )


@dataclass(frozen=True)
class MatchTable:
    """The concatenated matches of one class in F frames.

    matches: of all K detections and M objects, as if they were in one frame.
    detection_frame, truth_frame: (K,) and (M,) int64, the frame of each.
    """

    matches: FrameMatches
    detection_frame: Int64
    truth_frame: Int64
    n_frames: int

    @classmethod
    def of(cls, frames: Sequence[FrameMatches]) -> MatchTable:
        """Concatenate the matches of several frames."""
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
        """The same matches with only some objects evaluated: a mask `truths` (M,), such as of near ones.

        Detections of other objects are ignored. A false positive is counted only if it is in the mask
        `detections` (K,), such as of near ones.
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
