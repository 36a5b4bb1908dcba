"""The objects that an attack targets: ground truth that the detector could find."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, count_points
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi


@dataclass(frozen=True)
class AttackTargets:
    """M objects as a detector represents them: boxes (M, 7) float32 and labels (M,) int64."""

    boxes: Tensor
    labels: Tensor

    def __len__(self) -> int:
        return len(self.boxes)


def find_targets(detector: ObjectDetector, cloud: Cloud, boxes: Boxes) -> AttackTargets:
    """The M of the true boxes that the detector could find in a cloud (N,).

    These are of its classes, in its range, and hold at least `MIN_POINTS` points of the cloud.
    """
    label_of = np.array([detector.classes.index(c) if c in detector.classes else -1 for c in CLASSES])
    labels = label_of[boxes.labels]
    wanted = (
        (labels >= 0)
        & detector.range_m.contains_centres(boxes.geometry)
        & (count_points(xyz(cloud), boxes.geometry) >= MIN_POINTS)
    )
    return AttackTargets(
        torch.from_numpy(boxes.geometry[wanted].astype(np.float32)),
        torch.from_numpy(labels[wanted].astype(np.int64)),
    )


def detection_loss(detector: ObjectDetector, cloud: Cloud, targets: AttackTargets) -> float:
    """The detector's loss on the finite points of a cloud (N,), without a unit; NaN without targets."""
    if not len(targets):
        return float("nan")
    points = xyzi(cloud)
    points = points[np.isfinite(points).all(axis=1)]
    with torch.no_grad():
        return float(detector.loss(torch.from_numpy(points), targets.boxes, targets.labels))
