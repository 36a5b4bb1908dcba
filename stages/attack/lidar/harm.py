"""How much each object suffers from an attack, by what the detector really finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.cloud import Cloud
from advpipe.pipeline.detector.protocol import Detections, Detector
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU
from advpipe.stages.attack.lidar.targets import Targets

Float64 = npt.NDArray[np.float64]
Harm = Callable[[Cloud], Float64]
"""The harm (M,) that a cloud does to each of M objects: 0 for none, about 1 for all there is."""

FAINT = 0.5
"""The most that an object suffers by a lower score: average precision hardly asks how high it is."""

MISPLACED = 0.25
"""What a sure detection that is off its object adds: it costs precision beside the object."""

ENOUGH = 0.9
"""An object that has suffered so much needs no more."""


@dataclass(frozen=True)
class Hiding:
    """Harm done by losing objects: (M,) in [0, 1 + MISPLACED] for M targets, 0 as long as nothing changed.

    An object counts as found by the criterion of the mAP: a detection of its class with the strict 3D IoU.
    One that was not found in the clean cloud cannot suffer.
    """

    detector: Detector
    targets: Targets
    clean_score: Float64
    clean_misplaced: Float64

    @staticmethod
    def of(detector: Detector, targets: Targets, clean: Cloud) -> Hiding:
        return Hiding(detector, targets, *_scores(detector.detect(clean), targets, detector.classes))

    def __call__(self, cloud: Cloud) -> Float64:
        score, misplaced = _scores(self.detector.detect(cloud), self.targets, self.detector.classes)
        was = self.clean_score
        faint = FAINT * np.clip(1 - score / np.maximum(was, 1e-9), 0, 1)
        harm = np.where(score > 0, faint, 1.0) + MISPLACED * np.clip(misplaced - self.clean_misplaced, 0, 1)
        return np.where(was > 0, harm, 0.0)


@dataclass(frozen=True)
class Conjuring:
    """Harm done by finding what is not there: the score (M,) of the best detection of each ghost, loosely."""

    detector: Detector
    ghosts: Targets

    def __call__(self, cloud: Cloud) -> Float64:
        found, classes = self.detector.detect(cloud), self.detector.classes
        overlap = _same_class(found, self.ghosts)
        least = np.array([LOOSE_IOU[classes[label]] for label in self.ghosts.labels.tolist()])
        return np.max((overlap >= least[:, None]) * found.scores, axis=1, initial=0.0)


def _scores(found: Detections, targets: Targets, classes: tuple[str, ...]) -> tuple[Float64, Float64]:
    """The best score (M,) of a detection that finds each target, and of one that is only near it."""
    overlap = _same_class(found, targets)
    strict = np.array([STRICT_IOU[classes[label]] for label in targets.labels.tolist()])
    hit = overlap >= strict[:, None]
    # A detection that finds one object is not the misplaced one of its neighbour.
    off = (overlap > 0.05) & ~hit.any(axis=0)
    best = [np.max(kind * found.scores, axis=1, initial=0.0) for kind in (hit, off)]
    return best[0], best[1]


def _same_class(found: Detections, targets: Targets) -> Float64:
    """3D IoU (M, K) of targets with detections, 0 where their classes differ."""
    overlap: Float64 = iou_3d(targets.boxes.cpu().numpy(), found.boxes)
    overlap *= targets.labels.cpu().numpy()[:, None] == found.labels
    return overlap
