"""One frame's ground truth, the detections in a cloud of it, and how the two match."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.plugins import plugin_errors, user_class
from advpipe.pipeline.defences.base import Placement
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, Range
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, count_points
from advpipe.pipeline.geometry.iou import iou_3d, iou_bev
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU
from advpipe.pipeline.metrics.matching import match_overlaps
from advpipe.stages.evaluate.detection.matches import Matches, labelled

Bool = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]

AS_RECORDED = Placement()
"""The placement of a cloud that no defence moved."""


@dataclass(frozen=True)
class Criterion:
    """When a detection matches an object: the least overlap in `space` for each class."""

    title: str
    space: str
    min_iou: Mapping[str, float]


CRITERIA: Mapping[str, Criterion] = {
    "strict": Criterion("3D strict", "3d", STRICT_IOU),
    "loose": Criterion("3D loose", "3d", LOOSE_IOU),
    "bev": Criterion("bird's-eye strict", "bev", STRICT_IOU),
    "bev_loose": Criterion("bird's-eye loose", "bev", LOOSE_IOU),
}

_OVERLAP = {"3d": iou_3d, "bev": iou_bev}


@dataclass(frozen=True, slots=True)
class Truth:
    """The M objects of a frame, in the LiDAR's frame.

    is_findable: (M,), in the detector's range and of a class it finds.
    is_evaluated: (M,), findable and with enough points in the clean cloud.
    points: (M,) in the clean cloud. occlusion: (M,) share that something hides; NaN where unknown.
    uncounted: other objects and regions, which count neither way.
    """

    boxes: Boxes
    is_findable: Bool
    is_evaluated: Bool
    points: Int64
    occlusion: Float64
    uncounted: Uncounted = field(default_factory=Uncounted)

    def counted_on(self, cloud: Cloud) -> Truth:
        """The objects, evaluated by their points in another cloud."""
        points = count_points(xyz(cloud), self.boxes.geometry)
        return replace(self, is_evaluated=self.is_findable & (points >= MIN_POINTS), points=points)


def ground_truth(
    clean: Frame, classes: tuple[str, ...], range_m: Range, occlusion: Mapping[str, float] | None = None
) -> Truth:
    """The ground truth of a clean frame for a detector of these classes and this range.

    occlusion: of the objects by their id, where it is known.
    """
    boxes = clean.boxes
    known = np.isin(boxes.labels, [CLASSES.index(name) for name in classes])
    points = count_points(xyz(clean.cloud), boxes.geometry)
    findable = known & range_m.contains_centres(boxes.geometry)
    hidden = [(occlusion or {}).get(name, np.nan) for name in boxes.ids]
    evaluated = findable & (points >= MIN_POINTS)
    occlusion_of = np.array(hidden, dtype=np.float64)
    return Truth(boxes, findable, evaluated, points, occlusion_of, clean.uncounted)


def known_classes(detector: ObjectDetector) -> tuple[str, ...]:
    """The classes that a detector finds, in the order of `geometry.boxes.CLASSES`."""
    return tuple(name for name in CLASSES if name in detector.classes)


MOST_CACHED = 256
"""Results that are kept: more than the clouds of one frame that several bags and baselines share."""


class CachedDetector:
    """A detector that runs once on a cloud, however many bags and baselines of a frame share it."""

    def __init__(self, detector: ObjectDetector) -> None:
        self.classes = known_classes(detector)
        self.range_m = detector.range_m
        self._detector = detector
        self._own = user_class(detector)
        self._labels = np.array([CLASSES.index(name) for name in detector.classes], dtype=np.int64)
        self._seen: dict[bytes, Detections] = {}

    def detect(self, cloud: Cloud, placement: Placement = AS_RECORDED) -> Detections:
        """The detections in the detector's range, labelled by `geometry.boxes.CLASSES`, best first.

        placement: how a defence moved the cloud; the boxes are moved back.
        """
        about = f"{placement}".encode()
        key = hashlib.blake2b(np.ascontiguousarray(cloud).tobytes() + about, digest_size=16).digest()
        if key not in self._seen:
            with plugin_errors(self._own):
                seen = self._detector.detect(cloud)
            found = self._checked(seen)
            boxes = placement.boxes_back(found.boxes)
            inside = np.flatnonzero(self.range_m.contains_centres(boxes))
            best = inside[np.argsort(-found.scores[inside], kind="stable")]
            if len(self._seen) == MOST_CACHED:
                del self._seen[next(iter(self._seen))]  # the oldest
            self._seen[key] = Detections(boxes[best], found.scores[best], self._labels[found.labels[best]])
        return self._seen[key]

    def _checked(self, found: Detections) -> Detections:
        """The detections. Raises AdvpipeError if they break the contract of `Detections`: the class may be a
        user's own."""
        count = len(found.boxes)
        shapes = (found.boxes.shape, found.scores.shape, found.labels.shape)
        if shapes != ((count, 7), (count,), (count,)):
            problem = f"shapes {shapes} of boxes, scores and labels"
        elif not (np.isfinite(found.boxes).all() and np.isfinite(found.scores).all()):
            problem = "boxes or scores that are not finite"
        elif not ((found.labels >= 0) & (found.labels < len(self._labels))).all():
            problem = f"labels beyond its {len(self._labels)} classes"
        else:
            return found
        raise AdvpipeError(f"{type(self._detector).__name__}.detect gave {problem}; fix the detector")


def match(
    truth: Truth, detections: Detections, classes: tuple[str, ...], criteria: Sequence[str] = tuple(CRITERIA)
) -> Matches:
    """The matches of a frame by every criterion and class.

    A detection that matches no object is ignored, not a false positive, if it overlaps a box that counts
    neither way as much as an object of its class would have to, or lies where objects are not labelled.
    """
    spaces = {CRITERIA[name].space for name in criteria}
    overlaps = {
        space: iou(detections.boxes, truth.boxes.geometry)
        for space, iou in _OVERLAP.items()
        if space in spaces
    }
    uncounted = {space: _uncounted_overlap(truth.uncounted, detections, space) for space in spaces}
    scores = np.asarray(detections.scores, np.float64)  # a detector's own may have other digits
    found_by = np.full((len(criteria), len(truth.boxes)), -1, dtype=np.int32)
    is_ignored = np.ones((len(criteria), len(detections)), dtype=bool)
    for name in classes:
        mine, theirs = (np.flatnonzero(labelled(boxes.labels, name)) for boxes in (truth.boxes, detections))
        for row, criterion in enumerate(criteria):
            space, min_iou = CRITERIA[criterion].space, CRITERIA[criterion].min_iou[name]
            found = match_overlaps(
                overlaps[space][np.ix_(theirs, mine)],
                truth.is_evaluated[mine],
                scores[theirs],
                min_iou,
            ).ignoring(uncounted[space][theirs] >= min_iou)
            found_by[row, mine] = np.append(theirs, -1)[found.found_by]
            is_ignored[row, theirs] = found.is_ignored
    return Matches(
        tuple(criteria),
        classes,
        truth.boxes.labels,
        truth.is_evaluated,
        detections.labels,
        scores,
        found_by,
        is_ignored,
    )


def _uncounted_overlap(uncounted: Uncounted, detections: Detections, space: str) -> Float64:
    """The largest overlap (K,) of each detection with a box that counts neither way; infinite where objects
    are not labelled."""
    overlap = _OVERLAP[space](detections.boxes, uncounted.boxes.geometry).max(axis=1, initial=0.0)
    return np.where(uncounted.ignores_centres(detections.boxes), np.inf, overlap)


def found_objects(matches: Matches, min_score: float, criterion: str = "loose") -> Bool:
    """Which objects (M,) are evaluated and found by a criterion with at least this score."""
    return matches.of_all_classes(criterion).found(min_score)


def false_positives(matches: Matches, min_score: float) -> Bool:
    """Which detections (K,) of at least this score find nothing by the loose criterion."""
    return matches.of_all_classes("loose").is_false_positive(min_score)


def new_boxes(detections: Detections, known: Detections, min_score: float) -> Bool:
    """Which detections (K,) overlap none of their class among the known ones of at least this score."""
    overlap = iou_3d(detections.boxes, known.boxes)
    overlap[(detections.labels[:, None] != known.labels) | (known.scores < min_score)] = 0.0
    least = np.array([LOOSE_IOU[CLASSES[label]] for label in detections.labels])
    new: Bool = overlap.max(axis=1, initial=0.0) < least
    return new
