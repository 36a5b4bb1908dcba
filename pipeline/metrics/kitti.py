"""Average precision by KITTI's own program: its classes, difficulties, ignored regions and recall positions.

`metrics.average_precision` reads precision at every score and has no regions of the image; here everything is
as in KITTI's `evaluate_object` (Geiger, Lenz, Urtasun, CVPR 2012), so that figures can stand beside published
ones. The 3D and bird's-eye variants follow OpenPCDet's port of that program.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.kitti_matching import (
    Bool,
    Float64,
    KittiMatches,
    PaddedFrames,
    match_by_overlap,
    scores_of_matches,
)
from advpipe.pipeline.metrics.kitti_objects import KittiObjects, KittiOverlaps

KITTI_CLASSES = ("Car", "Pedestrian", "Cyclist")

NEIGHBOURS: Mapping[str, str] = {"Car": "Van", "Pedestrian": "Person_sitting"}
"""The class that resembles each class: its objects count neither way."""

N_THRESHOLDS = 41
"""The program samples the scores so that recall rises by 1/40 from one to the next."""


@dataclass(frozen=True)
class KittiDifficulty:
    """Which objects count; the others of the class count neither way, nor do lower detections.

    min_height_px: an object's 2D box is higher than this, and a detection's at least as high.
    """

    name: str
    min_height_px: float
    max_occlusion: int
    max_truncation: float


KITTI_DIFFICULTIES = (
    KittiDifficulty("easy", 40.0, 0, 0.15),
    KittiDifficulty("moderate", 25.0, 1, 0.30),
    KittiDifficulty("hard", 25.0, 2, 0.50),
)

KITTI_SPACES = ("bbox", "bev", "3d")
"""The 2D box in the image, the bird's-eye view, and 3D."""

KITTI_OVERLAPS: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    "official": {"bbox": (0.7, 0.5, 0.5), "bev": (0.7, 0.5, 0.5), "3d": (0.7, 0.5, 0.5)},
    "loose": {"bbox": (0.7, 0.5, 0.5), "bev": (0.5, 0.25, 0.25), "3d": (0.5, 0.25, 0.25)},
}
"""The overlap that a detection has to exceed, by set and space, of each of `KITTI_CLASSES`; `loose` is the
second set of OpenPCDet, which leaves the image strict."""


@dataclass(frozen=True)
class KittiPrecision:
    """The average precision of one class at one difficulty.

    space: one of `KITTI_SPACES`, or `aos` for the average orientation similarity of the 2D boxes. overlaps: a
    key of `KITTI_OVERLAPS`. min_iou: the overlap that it holds. objects: how many count; with few, the value
    says little, and with none it is 0, as in KITTI's program. r11, r40: in [0, 1], with 11 recall positions
    (before 2019) and with 40.
    """

    class_name: str
    difficulty: str
    space: str
    overlaps: str
    min_iou: float
    objects: int
    r11: float
    r40: float


def kitti_precisions(
    truth: Sequence[KittiObjects], detections: Sequence[KittiObjects]
) -> tuple[KittiPrecision, ...]:
    """The average precisions of every class, difficulty, space and set of overlaps.

    truth, detections: of the same frames in the same order; detections have scores. The orientation
    similarity is left out where detections have no `alpha_rad` (KITTI writes -10).

    Raises ValueError for lists of different lengths and detections without scores.
    """
    if len(truth) != len(detections):
        raise ValueError(f"{len(truth)} frames of truth, but {len(detections)} of detections")
    if any(frame.scores is None for frame in detections):
        raise ValueError("detections without scores")
    overlaps = [KittiOverlaps.of(*frame) for frame in zip(truth, detections, strict=True)]
    has_alpha = all((frame.alpha_rad != -10).all() for frame in detections)
    found: list[KittiPrecision] = []
    for place, class_name in enumerate(KITTI_CLASSES):
        for difficulty in KITTI_DIFFICULTIES:
            padded = PaddedFrames.of(
                [_counting_objects(frame, class_name, difficulty) for frame in truth],
                [_counting_detections(frame, class_name, difficulty) for frame in detections],
                detections,
            )
            for space in KITTI_SPACES:
                matches = padded.matches_of(overlaps, space)
                for overlap_set, by_space in KITTI_OVERLAPS.items():
                    min_iou = by_space[space][place]
                    curves = dict(_curves(matches, space, min_iou, padded.n_objects, has_alpha))
                    for curve, values in curves.items():
                        about = (class_name, difficulty.name, curve, overlap_set, min_iou, padded.n_objects)
                        found.append(KittiPrecision(*about, *_averages(values)))
    return tuple(found)


def _counting_objects(frame: KittiObjects, class_name: str, difficulty: KittiDifficulty) -> tuple[Bool, Bool]:
    """Which objects (N,) take part, and which of those count neither way."""
    names = np.array([name.lower() for name in frame.names], dtype=np.str_)
    mine = names == class_name.lower()
    near = names == NEIGHBOURS.get(class_name, "").lower()
    counts = (
        (frame.occluded <= difficulty.max_occlusion)
        & (frame.truncated <= difficulty.max_truncation)
        & (frame.bbox_px[:, 3] - frame.bbox_px[:, 1] > difficulty.min_height_px)
    )
    return mine | near, ~(mine & counts)


def _counting_detections(
    frame: KittiObjects, class_name: str, difficulty: KittiDifficulty
) -> tuple[Bool, Bool]:
    """Which detections (N,) take part, and which of those count neither way: low ones, of any class."""
    names = np.array([name.lower() for name in frame.names], dtype=np.str_)
    low = np.abs(frame.bbox_px[:, 3] - frame.bbox_px[:, 1]) < difficulty.min_height_px
    return (names == class_name.lower()) | low, low


def _curves(
    matches: KittiMatches, space: str, min_iou: float, n_objects: int, has_alpha: bool
) -> Iterator[tuple[str, Float64]]:
    """Precision at each threshold, by space; with the 2D boxes also the orientation similarity."""
    thresholds = score_thresholds(scores_of_matches(matches, min_iou), n_objects)
    counts = match_by_overlap(matches, min_iou, thresholds)
    detected = counts.true_positives + counts.false_positives
    yield space, np.divide(counts.true_positives, detected, out=np.zeros(len(detected)), where=detected > 0)
    if space == "bbox" and has_alpha:
        yield "aos", np.divide(counts.similarity, detected, out=np.zeros(len(detected)), where=detected > 0)


def score_thresholds(scores: Float64, n_objects: int) -> Float64:
    """The scores at which precision is read, highest first: at most `N_THRESHOLDS`.

    scores: (K,) of the true positives. A score is taken where its recall comes nearer to the next multiple of
    1/40 than the recall of the next score; the lowest one is always taken.
    """
    falling = np.sort(scores)[::-1].tolist()
    taken, wanted = [], 0.0
    for place, score in enumerate(falling):
        is_last = place == len(falling) - 1
        here, following = (place + 1) / n_objects, (place + 2) / n_objects
        if not is_last and following - wanted < wanted - here:
            continue
        taken.append(score)
        wanted += 1 / (N_THRESHOLDS - 1.0)
    return np.array(taken, dtype=np.float64)


def _averages(values: npt.ArrayLike) -> tuple[float, float]:
    """The average precisions R11 and R40 of the precision at each threshold; 0 beyond the last one."""
    curve = np.zeros(N_THRESHOLDS)
    given = np.asarray(values, dtype=np.float64)
    curve[: len(given)] = np.maximum.accumulate(given[::-1])[::-1]
    return float(curve[::4].sum() / 11), float(curve[1:].sum() / 40)
