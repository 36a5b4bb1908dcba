"""Validation: the average precision of a detector on a drive that it was not trained on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, count_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU, average_precision, match_frame
from advpipe.stages.train.frames import LabelledCloud


@dataclass(frozen=True)
class ClassPrecision:
    """3D AP R40 of one class in percent (NaN without boxes), over this number of `boxes`."""

    boxes: int
    strict_percent: float
    loose_percent: float


@dataclass(frozen=True)
class ValidationDrive:
    """The chosen frames of a labelled bag."""

    bag: Path
    frames: range
    min_points: int

    def precision(self, detector: ObjectDetector, at_most: int | None = None) -> dict[str, ClassPrecision]:
        """Average precision by class, on all chosen frames, or on about `at_most` equally spaced ones."""
        frames = self.frames[:: max(1, round(len(self.frames) / (at_most or len(self.frames))))]
        chosen = FrameSlice(frames.start, frames.stop, frames.step)
        clouds = read_frames(self.bag, chosen)
        if at_most is None:
            clouds = track(clouds, "validate", total=len(frames))
        return validate(detector, clouds, self.min_points)


def strict_percents(precision: dict[str, ClassPrecision]) -> list[float]:
    """The strict average precision of every class in the order of `CLASSES`, NaN for a class that was not
    evaluated."""
    return [precision[name].strict_percent if name in precision else float("nan") for name in CLASSES]


def validate(
    detector: ObjectDetector, frames: Iterable[LabelledCloud], min_points: int
) -> dict[str, ClassPrecision]:
    """Average precision by class; boxes out of range or with too few points are ignored."""
    truths, found = [], []
    for frame in frames:
        boxes = frame.boxes.geometry
        evaluated = count_points(xyz(frame.cloud), boxes) >= min_points
        truths.append((frame.boxes, evaluated & detector.range_m.contains_centres(boxes)))
        found.append(detector.detect(frame.cloud))
    precision = {}
    for name in detector.classes:
        label, own_label = CLASSES.index(name), detector.classes.index(name)

        def percent(min_iou: float, label: int = label, own_label: int = own_label) -> float:
            matches = []
            for (truth, evaluated), detections in zip(truths, found, strict=True):
                of_class, detected = truth.labels == label, detections.labels == own_label
                matches.append(
                    match_frame(
                        truth.geometry[of_class],
                        evaluated[of_class],
                        detections.boxes[detected],
                        detections.scores[detected],
                        min_iou,
                    )
                )
            return 100 * average_precision(matches)

        count = int(sum(np.sum(evaluated & (truth.labels == label)) for truth, evaluated in truths))
        precision[name] = ClassPrecision(count, percent(STRICT_IOU[name]), percent(LOOSE_IOU[name]))
    return precision
