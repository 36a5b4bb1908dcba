"""Raw predictions to a short list of boxes: threshold, decode, rotated non-maximum suppression."""

from __future__ import annotations

from math import pi

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.detector.second.anchors import AnchorGrid, decode
from advpipe.pipeline.detector.second.head import Predictions
from advpipe.pipeline.detector.second.loss import DIRECTION_OFFSET_RAD
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.geometry.transforms import wrap_angle

SCORE_THRESHOLD = 0.1
NMS_IOU = 0.1
MAX_CANDIDATES = 1000
MAX_DETECTIONS = 100


@torch.no_grad()
def detections(
    predictions: Predictions, batch: int, grid: AnchorGrid, vote_iou: float | None = None
) -> Detections:
    """At most 100 boxes of cloud `batch` that score at least 0.1, best first.

    Suppression knows no classes: one place on the road holds one object. `vote_iou`: see `vote`.
    """
    best, labels = predictions.scores[batch].max(1)
    scores = torch.sigmoid(best)
    chosen = (scores >= SCORE_THRESHOLD).nonzero().squeeze(1)
    order = torch.sort(scores[chosen], descending=True, stable=True).indices[:MAX_CANDIDATES]
    chosen = chosen[order]
    boxes = decode(predictions.codes[batch][chosen], grid.boxes(chosen))
    boxes = _with_direction(boxes, predictions.directions[batch][chosen])
    geometry = boxes.cpu().numpy().astype(np.float64)
    geometry[:, 6] = wrap_angle(geometry[:, 6])
    confidence = scores[chosen].cpu().numpy().astype(np.float64)
    names = labels[chosen].cpu().numpy()
    kept = suppress(geometry, NMS_IOU)[:MAX_DETECTIONS]
    voted = geometry[kept] if vote_iou is None else vote(geometry, confidence, names, kept, vote_iou)
    return Detections(voted, confidence[kept], names[kept])


def vote(
    boxes: npt.NDArray[np.float64],
    scores: npt.NDArray[np.float64],
    labels: npt.NDArray[np.int64],
    kept: npt.NDArray[np.int64],
    min_iou: float,
) -> npt.NDArray[np.float64]:
    """The kept boxes (K, 7), each replaced by the mean of the boxes (M, 7) that say nearly the same.

    Those are the boxes of its class that overlap it by more than `min_iou` in the bird's eye, weighted
    by their squared scores; headings count modulo pi, about that of the kept box. (Box voting: Gidaris
    and Komodakis 2015, section 5.)
    """
    agree = (iou_bev(boxes[kept], boxes) > min_iou) & (labels[kept][:, None] == labels)
    agree[np.arange(len(kept)), kept] = True
    weights = agree * scores**2
    weights /= weights.sum(axis=1, keepdims=True)
    turn_rad = (boxes[:, 6] - boxes[kept, 6][:, None] + pi / 2) % pi - pi / 2
    yaw_rad = boxes[kept, 6] + (weights * turn_rad).sum(axis=1)
    return np.column_stack([weights @ boxes[:, :6], wrap_angle(yaw_rad)])


def _with_direction(boxes: Tensor, directions: Tensor) -> Tensor:
    """Boxes turned to the half of the circle that the direction bin names."""
    half = torch.remainder(boxes[:, 6] - DIRECTION_OFFSET_RAD, pi)
    yaw = half + DIRECTION_OFFSET_RAD + pi * directions.argmax(1)
    return torch.cat([boxes[:, :6], yaw[:, None]], dim=1)


def suppress(boxes: npt.NDArray[np.float64], iou: float) -> npt.NDArray[np.int64]:
    """Indices of the boxes (K, 7), best first, that overlap no better kept box by more than `iou`."""
    overlaps = iou_bev(boxes, boxes) > iou
    alive = np.ones(len(boxes), dtype=bool)
    for i in range(len(boxes)):
        if alive[i]:
            alive[i + 1 :] &= ~overlaps[i, i + 1 :]
    return np.flatnonzero(alive)
