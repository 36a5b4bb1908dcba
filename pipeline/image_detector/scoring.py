"""Scores detections in pictures by KITTI's rules of difficulty: average precision at 40 recall positions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.iou import iou_2d, shared_areas
from advpipe.pipeline.image_detector.protocol import ImageDetections
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.messages.labels import ImageLabel
from advpipe.pipeline.metrics.average_precision import (
    STRICT_IOU,
    FrameMatches,
    RankedMatches,
    average_precision,
)
from advpipe.pipeline.metrics.kitti import KITTI_DIFFICULTIES, KittiDifficulty
from advpipe.pipeline.metrics.matching import match_overlaps

HALF = 0.5
"""The looser overlap, that of PASCAL VOC, for every class."""

OTHER = -1
"""The label of what is none of our classes: detections there count neither way."""

Float64 = npt.NDArray[np.float64]

_LABELS = {name: CLASSES.index(ours) for ours, name in KITTI_NAMES.items()}


@dataclass(frozen=True)
class PictureTruth:
    """The M objects in a picture. boxes_px: (M, 4), as in `ImageDetections`. labels: (M,), index into
    `geometry.boxes.CLASSES`, or `OTHER`. occlusion: (M,), KITTI's levels. truncation: (M,), shares."""

    boxes_px: Float64
    labels: npt.NDArray[np.int64]
    occlusion: npt.NDArray[np.int64]
    truncation: Float64

    @classmethod
    def of(cls, labels: Sequence[ImageLabel]) -> PictureTruth:
        """From the labels of a picture; unknown occlusions and truncations count in no difficulty."""
        return cls(
            np.array([each.edges_px for each in labels], np.float64).reshape(-1, 4),
            np.array([_LABELS.get(each.class_name, OTHER) for each in labels], np.int64),
            np.array([each.occlusion if each.occlusion >= 0 else 3 for each in labels], np.int64),
            np.array([each.truncation if each.truncation >= 0 else 1.0 for each in labels], np.float64),
        )

    def counts_at(self, difficulty: KittiDifficulty) -> npt.NDArray[np.bool_]:
        """Which of the objects (M,) count; a detection of another one counts neither way."""
        counts: npt.NDArray[np.bool_] = (
            (self.boxes_px[:, 3] - self.boxes_px[:, 1] > difficulty.min_height_px)
            & (self.occlusion <= difficulty.max_occlusion)
            & (self.truncation <= difficulty.max_truncation)
            & (self.labels != OTHER)
        )
        return counts


@dataclass(frozen=True)
class PicturePrecision:
    """AP R40, in [0, 1], of a class at a difficulty; NaN where no object counts.

    strict: at KITTI's overlaps (`STRICT_IOU`). half: at an IoU of 0.5.
    """

    class_name: str
    difficulty: str
    objects: int
    strict: float
    half: float


def picture_precisions(
    truths: Sequence[PictureTruth], found: Sequence[ImageDetections], classes: Sequence[str]
) -> Iterator[PicturePrecision]:
    """Of each class of a detector and each difficulty, over pictures in the same order."""
    for name in classes:
        for difficulty in KITTI_DIFFICULTIES:
            frames = [
                [
                    picture_matches(truth, each, classes.index(name), name, difficulty, min_iou)
                    for truth, each in zip(truths, found, strict=True)
                ]
                for min_iou in (STRICT_IOU[name], HALF)
            ]
            objects = sum(frame.n_truth for frame in frames[0])
            strict, half = map(average_precision, frames)
            yield PicturePrecision(name, difficulty.name, objects, strict, half)


@dataclass(frozen=True)
class ConditionScore:
    """One condition. strict, half: as in `PicturePrecision`. is_found: (N,), which of the objects that count,
    in all pictures one after the other, a detection finds with an overlap of `HALF`."""

    strict: float
    half: float
    is_found: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class PictureScores:
    """Of one class at one difficulty, clean and as it was shown. min_score: of the best F1 in the clean
    pictures, with which objects are found in either."""

    class_name: str
    difficulty: str
    objects: int
    min_score: float
    clean: ConditionScore
    shown: ConditionScore


def picture_scores(
    truths: Sequence[PictureTruth],
    clean: Sequence[ImageDetections],
    shown: Sequence[ImageDetections],
    classes: Sequence[str],
) -> Iterator[PictureScores]:
    """Of each class of a detector and each difficulty: two lists of detections at the same moments."""
    for name in classes:
        for difficulty in KITTI_DIFFICULTIES:
            strict, half = (
                [
                    [
                        picture_matches(truth, each, classes.index(name), name, difficulty, min_iou)
                        for truth, each in zip(truths, found, strict=True)
                    ]
                    for found in (clean, shown)
                ]
                for min_iou in (STRICT_IOU[name], HALF)
            )
            min_score = RankedMatches.of(half[0]).best_f1_score()
            conditions = [
                ConditionScore(average_precision(one), average_precision(other), _found(other, min_score))
                for one, other in zip(strict, half, strict=True)
            ]
            objects = sum(frame.n_truth for frame in half[0])
            yield PictureScores(name, difficulty.name, objects, min_score, *conditions)


def _found(frames: Sequence[FrameMatches], min_score: float) -> npt.NDArray[np.bool_]:
    return np.concatenate([np.zeros(0, bool), *(each.found(min_score)[each.is_evaluated] for each in frames)])


def picture_matches(
    truth: PictureTruth,
    found: ImageDetections,
    own_label: int,
    class_name: str,
    difficulty: KittiDifficulty,
    min_iou: float,
) -> FrameMatches:
    """The matches of one class in one picture; own_label: the detector's. Detections that are lower than the
    difficulty asks, or lie in a region of no class of ours, count neither way."""
    mine, of_class = truth.labels == CLASSES.index(class_name), found.labels == own_label
    boxes = found.boxes_px[of_class].astype(np.float64)
    matches = match_overlaps(
        iou_2d(boxes, truth.boxes_px[mine]),
        truth.counts_at(difficulty)[mine],
        found.scores[of_class].astype(np.float64),
        min_iou,
    )
    inside, area, _ = shared_areas(boxes, truth.boxes_px[truth.labels == OTHER])
    elsewhere = (inside > min_iou * area[:, None]).any(axis=1)
    return matches.ignoring((boxes[:, 3] - boxes[:, 1] < difficulty.min_height_px) | elsewhere)
