"""What two vehicles see, put together in the frame of one of them through the poses that they report."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import Boxes, count_points
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz

SAME_OBJECT_IOU = 0.15
"""In the bird's eye: of two boxes of a class that overlap by more, the better one stays (OpenCOOD's late
fusion, Xu et al., ICRA 2022)."""


def fuse_clouds(own: Cloud, others: Cloud, own_SE3_other: Float64) -> Cloud:
    """Both clouds in the frame of the first ("early fusion"); own_SE3_other: (4, 4)."""
    moved = others.copy()
    moved["x"], moved["y"], moved["z"] = transform_points(own_SE3_other, xyz(others)).T
    return np.concatenate([own, moved])


def fuse_detections(own: Detections, others: Detections, own_SE3_other: Float64) -> Detections:
    """Both in the frame of the first, each object once, best first ("late fusion")."""
    unknown = np.full((len(others), 3), np.nan)
    ids = ("",) * len(others)
    moved = Boxes(others.boxes, others.labels, ids, unknown).transformed(own_SE3_other).geometry
    boxes = np.concatenate([own.boxes, moved])
    scores = np.concatenate([own.scores, others.scores])
    labels = np.concatenate([own.labels, others.labels])
    best = np.argsort(-scores, kind="stable")
    overlap = iou_bev(boxes[best], boxes[best]) > SAME_OBJECT_IOU
    overlap &= labels[best][:, None] == labels[best][None, :]
    kept: list[int] = []
    for row in range(len(best)):
        if not overlap[row, kept].any():
            kept.append(row)
    chosen = best[kept]
    return Detections(boxes[chosen], scores[chosen], labels[chosen])


def without_oneself(found: Detections) -> Detections:
    """Without boxes around the sensor itself: another sees this vehicle, which is no object to it."""
    over = np.array([count_points(np.array([[0.0, 0.0, box[2]]]), box[None])[0] > 0 for box in found.boxes])
    kept = np.flatnonzero(~over.astype(bool))
    return Detections(found.boxes[kept], found.scores[kept], found.labels[kept])
