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
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.geometry.transforms import wrap_angle

SCORE_THRESHOLD = 0.1


@torch.no_grad()
def detections(predictions: Predictions, batch: int, grid: AnchorGrid) -> Detections:
    """The boxes of cloud `batch` whose class scores at least 0.1, best first, at most as many as the preset
    says.

    Suppression knows no classes: one place on the road holds one object. Where the head predicts the
    quality of boxes, it counts as the preset's `quality_power` says.
    """
    preset = grid.preset
    best, labels = predictions.scores[batch].max(1)
    scores = torch.sigmoid(best)
    chosen = (scores >= SCORE_THRESHOLD).nonzero().squeeze(1)
    if predictions.qualities is not None and preset.quality_power is not None:
        scores = scores * torch.sigmoid(predictions.qualities[batch]) ** preset.quality_power
    order = torch.sort(scores[chosen], descending=True, stable=True).indices[: preset.max_candidates]
    chosen = chosen[order]
    boxes = decode(predictions.codes[batch][chosen], grid.boxes(chosen))
    boxes = _with_direction(boxes, predictions.directions[batch][chosen], preset.direction_offset_rad)
    geometry = boxes.cpu().numpy().astype(np.float64)
    geometry[:, 6] = wrap_angle(geometry[:, 6])
    confidence = scores[chosen].cpu().numpy().astype(np.float64)
    names = labels[chosen].cpu().numpy()
    kept = suppress(geometry, preset.nms_iou, preset.max_detections)
    if preset.vote_iou is None:
        return Detections(geometry[kept], confidence[kept], names[kept])
    voted = vote(geometry, confidence, names, kept, preset.vote_iou)
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


def _with_direction(boxes: Tensor, directions: Tensor, offset_rad: float) -> Tensor:
    """Boxes turned to the half of the circle that the direction bin names."""
    half = torch.remainder(boxes[:, 6] - offset_rad, pi)
    yaw = half + offset_rad + pi * directions.argmax(1)
    return torch.cat([boxes[:, :6], yaw[:, None]], dim=1)


def suppress(boxes: npt.NDArray[np.float64], iou: float, limit: int) -> npt.NDArray[np.int64]:
    """Indices of the boxes (K, 7), best first, that overlap no better kept box by more than `iou`.

    At most the first `limit` of them.
    """
    kept: list[int] = []
    # Few boxes survive, so only their overlaps are computed.
    alive = np.arange(len(boxes))
    while len(alive) and len(kept) < limit:
        best, rest = alive[0], alive[1:]
        kept.append(int(best))
        alive = rest[iou_bev(boxes[best], boxes[rest])[0] <= iou]
    return np.array(kept, dtype=np.int64)
