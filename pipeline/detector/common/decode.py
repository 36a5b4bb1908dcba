"""Raw predictions to a short list of boxes: threshold, decode, rotated non-maximum suppression."""

from __future__ import annotations

from math import pi

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.detector.common.anchors import AnchorGrid, decode_boxes
from advpipe.pipeline.detector.common.head import Predictions
from advpipe.pipeline.detector.common.preset import SuppressionPreset
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.geometry.transforms import wrap_angle

SCORE_THRESHOLD = 0.1

BLOCK = 16
"""How many of the best boxes suppress others at a time."""


@torch.no_grad()
def decode_detections(predictions: Predictions, batch: int, grid: AnchorGrid) -> Detections:
    """The boxes of cloud `batch` whose class scores at least 0.1, best first, at most `max_detections`.

    Each anchor yields its best class or, with `suppress_by_class`, each class above the threshold, and
    suppression is then applied within each class. Where the head predicts the quality of boxes, scores are
    those of `rated`.
    """
    preset = grid.preset
    of_classes = torch.sigmoid(predictions.scores[batch])
    if preset.suppress_by_class:
        anchors, labels = (of_classes >= SCORE_THRESHOLD).nonzero().unbind(1)
    else:
        best, labels = of_classes.max(1)
        anchors = (best >= SCORE_THRESHOLD).nonzero().squeeze(1)
        labels = labels[anchors]
    scores = of_classes[anchors, labels]
    if predictions.qualities is not None and preset.quality_power is not None:
        scores = rated(scores, predictions.qualities[batch][anchors], preset.quality_power)
    order = torch.sort(scores, descending=True, stable=True).indices[: preset.max_candidates]
    chosen = anchors[order]
    boxes = decode_boxes(predictions.codes[batch][chosen], grid.boxes(chosen))
    boxes = _with_direction(boxes, predictions.directions[batch][chosen], preset.direction_offset_rad)
    return suppressed_detections(boxes, scores[order], labels[order], preset)


def rated(scores: Tensor, qualities: Tensor, power: float) -> Tensor:
    """Scores (K,) of classes times the qualities of boxes, given as logits (K,), to a power (Wu et al. 2020,
    equation 4); the product, raised to 2 / (1 + power), is about as large as with a power of one."""
    return (scores * torch.sigmoid(qualities) ** power) ** (2 / (1 + power))


def suppressed_detections(
    boxes: Tensor, scores: Tensor, labels: Tensor, preset: SuppressionPreset
) -> Detections:
    """The candidates (K, 7) that survive non-maximum suppression, given best first, as the preset says."""
    geometry = boxes.cpu().numpy().astype(np.float64)
    geometry[:, 6] = wrap_angle(geometry[:, 6])
    confidence = scores.cpu().numpy().astype(np.float64)
    names = labels.cpu().numpy()
    rivals = names if preset.suppress_by_class else np.zeros_like(names)
    kept = suppress(geometry, rivals, preset.nms_iou, preset.max_detections)
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
    """The kept boxes (K, 7), each replaced by the weighted mean of the boxes (M, 7) that overlap it.

    These are the boxes of its class that overlap it by more than `min_iou` in bird's-eye view, weighted by
    their squared scores; headings are averaged modulo pi, relative to the kept box's heading. (Box voting:
    Gidaris and Komodakis 2015, section 5.)
    """
    agree = (iou_bev(boxes[kept], boxes) > min_iou) & (labels[kept][:, None] == labels)
    agree[np.arange(len(kept)), kept] = True
    weights = agree * scores**2
    weights /= weights.sum(axis=1, keepdims=True)
    turn_rad = (boxes[:, 6] - boxes[kept, 6][:, None] + pi / 2) % pi - pi / 2
    yaw_rad = boxes[kept, 6] + (weights * turn_rad).sum(axis=1)
    return np.column_stack([weights @ boxes[:, :6], wrap_angle(yaw_rad)])


def _with_direction(boxes: Tensor, directions: Tensor, offset_rad: float) -> Tensor:
    """Boxes turned to the half of the circle that the direction bin predicts."""
    half = torch.remainder(boxes[:, 6] - offset_rad, pi)
    yaw = half + offset_rad + pi * directions.argmax(1)
    return torch.cat([boxes[:, :6], yaw[:, None]], dim=1)


def suppress(
    boxes: npt.NDArray[np.float64], groups: npt.NDArray[np.int64], iou: float, limit: int
) -> npt.NDArray[np.int64]:
    """Non-maximum suppression: indices of the kept boxes of K boxes (K, 7) sorted best first.

    A box is kept unless it overlaps a better kept box of its group (K,) by more than `iou`; at most `limit`
    boxes are kept.
    """
    of_groups = [
        _kept_of_group(boxes, np.flatnonzero(groups == each), iou, limit) for each in np.unique(groups)
    ]
    return np.sort(np.concatenate([np.zeros(0, np.int64), *of_groups]))[:limit]


def _kept_of_group(
    boxes: npt.NDArray[np.float64], alive: npt.NDArray[np.int64], iou: float, limit: int
) -> npt.NDArray[np.int64]:
    """The boxes of one group that are kept, of those given by index (K,)."""
    kept: list[int] = []
    # Few boxes survive, so overlaps are computed for some of the best at a time.
    while len(alive) and len(kept) < limit:
        block = alive[:BLOCK]
        covers = iou_bev(boxes[block], boxes[alive]) > iou
        is_covered = np.zeros(len(alive), np.bool_)
        for row, index in enumerate(block.tolist()):
            if not is_covered[row]:
                kept.append(index)
                is_covered |= covers[row]
        alive = alive[len(block) :][~is_covered[len(block) :]]
    return np.array(kept[:limit], dtype=np.int64)
