"""The objects that an attack targets: ground truth that the detector could find."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.detector.no_detector import NoDetector
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, count_points
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_of_xyzi, xyz, xyzi

Float32 = npt.NDArray[np.float32]

NO_POINTS: Cloud = np.zeros(0, POINT_DTYPE)


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
    if not len(boxes):
        return AttackTargets(torch.zeros((0, 7)), torch.zeros(0, dtype=torch.int64))
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


def look(detector: ObjectDetector, points: Float32, targets: AttackTargets) -> tuple[float, Detections]:
    """The detector's loss on points (N, 4), all finite, without a unit, NaN without targets; and what it
    detects in them, in the same pass if it is a `VoxelDetector` that can."""
    if isinstance(detector, NoDetector):
        return float("nan"), detector.detect(NO_POINTS)
    given = torch.from_numpy(points)
    if len(targets) and isinstance(detector, VoxelDetector):
        with torch.no_grad():
            computed = detector.occupancy_loss(given, targets.boxes, targets.labels)
        loss, found = float(computed.loss), computed.found
    else:
        with torch.no_grad():
            loss = (
                float(detector.loss(given, targets.boxes, targets.labels)) if len(targets) else float("nan")
            )
        found = None
    return loss, detector.detect(cloud_of_xyzi(points)) if found is None else found


def detection_loss(detector: ObjectDetector, cloud: Cloud, targets: AttackTargets) -> float:
    """The detector's loss on the finite points of a cloud (N,), without a unit; NaN without targets."""
    if not len(targets):
        return float("nan")
    points = xyzi(cloud)
    points = points[np.isfinite(points).all(axis=1)]
    with torch.no_grad():
        return float(detector.loss(torch.from_numpy(points), targets.boxes, targets.labels))
