"""A detector as a black-box attacker sees it: clouds go in, and detections come out.

Score-based attacks see boxes, classes and scores; decision-based ones see the boxes and classes that a user
acts on, without scores.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.adversary.constraints import BLACK_BOX, SCORE_BASED
from advpipe.pipeline.adversary.forwarding import ForwardingDetector
from advpipe.pipeline.adversary.goal import DETECTED_SCORE
from advpipe.pipeline.detector.ensemble import EnsembleDetections
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.messages.cloud import Cloud

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class BlackBoxDetector(ForwardingDetector):
    """An `ObjectDetector` that answers queries and hides its loss. scores: whether it tells them; otherwise
    detections of a score of at least `DETECTED_SCORE` all have score 1, in the order of their places."""

    scores: bool = True

    def detect(self, cloud: Cloud) -> Detections:
        return told_by(self, self.detector.detect(cloud))

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """A constant: there is no loss to follow."""
        return points.new_zeros(())


def as_seen_by(recipe: str, detector: ObjectDetector) -> ObjectDetector:
    """What a recipe sees of the detector."""
    if recipe not in BLACK_BOX:
        return detector
    return BlackBoxDetector(detector, scores=recipe == SCORE_BASED)


def told_by(seen: ObjectDetector, found: Detections) -> Detections:
    """What a detector, as it is seen, tells of the objects found."""
    if not isinstance(seen, BlackBoxDetector) or seen.scores:
        return found
    sure = np.flatnonzero(found.scores >= DETECTED_SCORE)
    sure = sure[np.lexsort(found.boxes[sure].T)]
    told = Detections(found.boxes[sure], np.ones(len(sure)), found.labels[sure])
    if isinstance(found, EnsembleDetections):
        return EnsembleDetections(told.boxes, told.scores, told.labels, found.member[sure], found.members)
    return told
