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
def detections(predictions: Predictions, batch: int, grid: AnchorGrid) -> Detections:
    """At most 100 boxes of cloud `batch` that score at least 0.1, best first.

    Suppression knows no classes: one place on the road holds one object.
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
    kept = suppress(geometry, NMS_IOU)[:MAX_DETECTIONS]
    return Detections(
        geometry[kept],
        scores[chosen].cpu().numpy().astype(np.float64)[kept],
        labels[chosen].cpu().numpy()[kept],
    )


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
