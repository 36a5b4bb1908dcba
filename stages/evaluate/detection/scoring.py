"""One frame's ground truth, what the detector made of a cloud of it, and how the two match."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.cloud import Cloud, xyz
from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.detector.protocol import Detections, Detector, Range
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, count_points
from advpipe.pipeline.geometry.iou import iou_3d, iou_bev
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU, FrameMatches, match_frame

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Criterion:
    """When a detection counts as the object: an overlap, and how much of it for each class."""

    iou: Callable[[Float64, Float64], Float64]
    min_iou: Mapping[str, float]


CRITERIA: Mapping[str, Criterion] = {
    "strict": Criterion(iou_3d, STRICT_IOU),
    "loose": Criterion(iou_3d, LOOSE_IOU),
    "bev": Criterion(iou_bev, STRICT_IOU),
}

Matches = Mapping[tuple[str, str], FrameMatches]
"""By criterion and class."""


@dataclass(frozen=True)
class Truth:
    """The objects of a frame in the LiDAR's frame; both masks are (M,).

    is_evaluated: in the detector's range, of a class it finds, with enough points in the clean cloud.
    """

    boxes: Boxes
    is_evaluated: Bool

    def enough_points(self, cloud: Cloud) -> Bool:
        """Which objects (M,) have enough points in a cloud."""
        enough: Bool = count_points(xyz(cloud), self.boxes.geometry) >= MIN_POINTS
        return enough


def ground_truth(clean: Frame, classes: tuple[str, ...], range_m: Range) -> Truth:
    """The ground truth of a clean frame for a detector of these classes and this range."""
    boxes = clean.boxes
    known = np.isin(boxes.labels, [CLASSES.index(name) for name in classes])
    points = count_points(xyz(clean.cloud), boxes.geometry)
    return Truth(boxes, known & range_m.contains_centres(boxes.geometry) & (points >= MIN_POINTS))


class Eye:
    """A detector that looks at each cloud once, however many bags and baselines share it."""

    def __init__(self, detector: Detector) -> None:
        self.classes = tuple(name for name in CLASSES if name in detector.classes)
        self.range_m = detector.range_m
        self._detector = detector
        self._labels = np.array([CLASSES.index(name) for name in detector.classes], dtype=np.int64)
        self._seen: dict[bytes, Detections] = {}

    def detect(self, cloud: Cloud) -> Detections:
        """The detections in the detector's range, labelled by `geometry.boxes.CLASSES`, best first."""
        key = hashlib.blake2b(np.ascontiguousarray(cloud).tobytes(), digest_size=16).digest()
        if key not in self._seen:
            found = self._detector.detect(cloud)
            inside = np.flatnonzero(self.range_m.contains_centres(found.boxes))
            best = inside[np.argsort(-found.scores[inside], kind="stable")]
            self._seen[key] = Detections(
                found.boxes[best], found.scores[best], self._labels[found.labels[best]]
            )
        return self._seen[key]


def match(truth: Truth, detections: Detections, classes: tuple[str, ...]) -> Matches:
    """The matches of a frame by every criterion and class."""
    matches = {}
    for name in classes:
        label = CLASSES.index(name)
        of_truth, of_detections = truth.boxes.labels == label, detections.labels == label
        for word, criterion in CRITERIA.items():
            matches[word, name] = match_frame(
                truth.boxes.geometry[of_truth],
                truth.is_evaluated[of_truth],
                detections.boxes[of_detections],
                detections.scores[of_detections],
                criterion.min_iou[name],
                criterion.iou,
            )
    return matches


def found_objects(truth: Truth, matches: Matches, min_score: float) -> Bool:
    """Which objects (M,) are evaluated and found by the loose criterion with at least this score."""
    found = np.zeros(len(truth.boxes), dtype=bool)
    for (word, name), frame in matches.items():
        if word == "loose":
            found[truth.boxes.labels == CLASSES.index(name)] = frame.found(min_score)
    return found


def false_positives(detections: Detections, matches: Matches, min_score: float) -> Bool:
    """Which detections (K,) of at least this score find nothing by the loose criterion."""
    wrong = np.zeros(len(detections), dtype=bool)
    for (word, name), frame in matches.items():
        if word == "loose":
            wrong[detections.labels == CLASSES.index(name)] = frame.is_false_positive(min_score)
    return wrong


def new_boxes(detections: Detections, known: Detections, min_score: float) -> Bool:
    """Which detections (K,) overlap none of their class among the known ones of at least this score."""
    overlap = iou_3d(detections.boxes, known.boxes)
    overlap[(detections.labels[:, None] != known.labels) | (known.scores < min_score)] = 0.0
    least = np.array([LOOSE_IOU[CLASSES[label]] for label in detections.labels])
    new: Bool = overlap.max(axis=1, initial=0.0) < least
    return new
