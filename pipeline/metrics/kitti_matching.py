"""The greedy matching of KITTI's program, vectorised over frames and score thresholds.

The program goes through the objects of a frame in order. To find the thresholds, an object takes the free
detection with the highest score; to count at a threshold, the one with the largest overlap, and one that
counts neither way only where there is no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.kitti_objects import KittiObjects, KittiOverlaps

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

Counting = tuple[Bool, Bool]
"""Of the objects or detections of a frame (N,): which take part, and which count neither way."""

_CHUNK = 1 << 22


@dataclass(frozen=True)
class KittiMatches:
    """F frames with at most K detections and N objects that take part, in one space.

    overlap, similarity: (F, K, N), 0 where there is no pair. scores: (F, K). is_detection, is_object: where
    there is one. neither: whether a detection (F, K), or an object (F, N), counts neither way. dont_care:
    (F, K) share of a detection in a region to be ignored; 0 outside of the image.
    """

    overlap: Float64
    similarity: Float64
    scores: Float64
    is_detection: Bool
    is_object: Bool
    detection_neither: Bool
    object_neither: Bool
    dont_care: Float64

    def chunks(self, thresholds: int) -> Iterator[KittiMatches]:
        """The frames in parts, to limit the memory of as many thresholds."""
        frames, detections = self.scores.shape
        step = max(1, _CHUNK // max(1, thresholds * detections))
        for first in range(0, frames, step):
            part = slice(first, first + step)
            yield KittiMatches(*(value[part] for value in vars(self).values()))


@dataclass(frozen=True)
class PaddedFrames:
    """The detections and objects of F frames that take part for one class and difficulty.

    detections: (F, K) and objects: (F, N) their indices in their frames, -1 for none. scores: (F, K).
    """

    detections: Int64
    objects: Int64
    detection_neither: Bool
    object_neither: Bool
    scores: Float64

    @classmethod
    def of(
        cls, truth: Sequence[Counting], found: Sequence[Counting], detections: Sequence[KittiObjects]
    ) -> PaddedFrames:
        """truth, found: what takes part in each frame, of its objects and of its detections."""
        known, rows = (_padded([np.flatnonzero(part) for part, _ in each]) for each in (truth, found))
        scores = [frame.scores if frame.scores is not None else np.zeros(0) for frame in detections]
        return cls(
            rows,
            known,
            _gathered([neither for _, neither in found], rows, True),
            _gathered([neither for _, neither in truth], known, True),
            _gathered(scores, rows, 0.0),
        )

    @property
    def n_objects(self) -> int:
        """How many objects count."""
        return int((~self.object_neither).sum())

    def matches_of(self, overlaps: Sequence[KittiOverlaps], space: str) -> KittiMatches:
        """What matching in a space needs; overlaps: of each frame."""
        shape = (*self.detections.shape, self.objects.shape[1])
        overlap, similarity = np.zeros(shape), np.zeros(shape)
        dont_care = np.zeros(self.detections.shape)
        for place, frame in enumerate(overlaps):
            rows, columns = self.detections[place], self.objects[place]
            rows, columns = rows[rows >= 0], columns[columns >= 0]
            pairs = np.ix_(rows, columns)
            overlap[place, : len(rows), : len(columns)] = frame.in_space(space)[pairs]
            if space == "bbox":
                similarity[place, : len(rows), : len(columns)] = frame.similarity[pairs]
                dont_care[place, : len(rows)] = frame.dont_care[rows]
        return KittiMatches(
            overlap,
            similarity,
            self.scores,
            self.detections >= 0,
            self.objects >= 0,
            self.detection_neither,
            self.object_neither,
            dont_care,
        )


@dataclass(frozen=True)
class ThresholdCounts:
    """At each of T thresholds: true positives, false positives, and the sum of the similarities, (T,)."""

    true_positives: Float64
    false_positives: Float64
    similarity: Float64


def scores_of_matches(matches: KittiMatches, min_iou: float) -> Float64:
    """The scores (P,) of the true positives without a threshold: each object takes the highest free score."""
    found = [np.zeros(0)]
    for part in matches.chunks(1):
        free = part.is_detection.copy()
        for number in range(part.is_object.shape[1]):
            candidates = free & (part.overlap[:, :, number] > min_iou) & part.is_object[:, number, None]
            rows = np.flatnonzero(candidates.any(axis=1))
            best = np.where(candidates[rows], part.scores[rows], -np.inf).argmax(axis=1)
            free[rows, best] = False
            counts = ~(part.object_neither[rows, number] | part.detection_neither[rows, best])
            found.append(part.scores[rows, best][counts])
    return np.concatenate(found)


def match_by_overlap(matches: KittiMatches, min_iou: float, thresholds: Float64) -> ThresholdCounts:
    """The counts at each threshold (T,), of detections with at least that score."""
    true, false, similarity = (np.zeros(len(thresholds)) for _ in range(3))
    for part in matches.chunks(len(thresholds)):
        free = part.is_detection[:, None] & (part.scores[:, None] >= thresholds[:, None])
        for number in range(part.is_object.shape[1]):
            near = (part.overlap[:, :, number] > min_iou) & part.is_object[:, number, None]
            rows = np.flatnonzero(near.any(axis=1))
            best, is_hit = _largest_overlap(part, rows, number, free[rows] & near[rows, None])
            neither = part.object_neither[rows, number, None] | part.detection_neither[rows[:, None], best]
            is_true = is_hit & ~neither
            true += is_true.sum(axis=0)
            similarity += np.where(is_true, part.similarity[rows[:, None], best, number], 0.0).sum(axis=0)
            place, at = np.nonzero(is_hit)
            free[rows[place], at, best[place, at]] = False
        wrong = free & ~(part.detection_neither | (part.dont_care > min_iou))[:, None]
        false += wrong.sum(axis=(0, 2))
    return ThresholdCounts(true, false, similarity)


def _largest_overlap(part: KittiMatches, rows: Int64, number: int, candidates: Bool) -> tuple[Int64, Bool]:
    """Of the candidates (R, T, K) for an object in frames `rows` (R,), the one (R, T) that it takes, and
    whether there is one: the first with the largest overlap, or else the first that counts neither way."""
    counting = candidates & ~part.detection_neither[rows, None]
    overlap = np.where(counting, part.overlap[rows, None, :, number], -1.0)
    best = np.where(counting.any(axis=2), overlap.argmax(axis=2), candidates.argmax(axis=2))
    is_hit: Bool = np.asarray(candidates.any(axis=2))
    return best.astype(np.int64), is_hit


def _padded(indices: Sequence[npt.NDArray[np.intp]]) -> Int64:
    """The indices of each frame (F, longest), at least one column, filled with -1."""
    table = np.full((len(indices), max([1, *map(len, indices)])), -1, dtype=np.int64)
    for row, found in zip(table, indices, strict=True):
        row[: len(found)] = found
    return table


def _gathered(values: Sequence[npt.NDArray[Any]], indices: Int64, fill: float) -> npt.NDArray[Any]:
    """The values of each frame at its padded indices (F, L)."""
    table = np.full(indices.shape, fill)
    for row, found, place in zip(table, values, indices, strict=True):
        row[place >= 0] = found[place[place >= 0]]
    return table
