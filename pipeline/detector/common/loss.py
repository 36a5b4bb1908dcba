"""The loss of an anchor head: focal classification, smooth L1 boxes, direction (Yan et al. 2018); and the
quality of boxes (Wu et al. 2020)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.detector.common.anchors import AnchorGrid, Targets, decode_boxes, encode_boxes
from advpipe.pipeline.detector.common.head import Predictions

SCORE_WEIGHT, BOX_WEIGHT, DIRECTION_WEIGHT, QUALITY_WEIGHT = 1.0, 2.0, 0.2, 0.5
LOSS_PARTS = ("score_loss", "box_loss", "direction_loss", "quality_loss")
ALPHA, GAMMA = 0.25, 2
BETA = 1 / 9


@dataclass(frozen=True)
class Losses:
    """The weighted parts, scalars, each normalised by the positive anchors of its cloud."""

    score: Tensor
    box: Tensor
    direction: Tensor
    quality: Tensor
    """Zero where the head predicts none."""

    @property
    def parts(self) -> tuple[Tensor, ...]:
        """In the order of `LOSS_PARTS`."""
        return self.score, self.box, self.direction, self.quality

    @property
    def total(self) -> Tensor:
        """The sum of all parts, a scalar."""
        return self.score + self.box + self.direction + self.quality


def losses(predictions: Predictions, targets: Sequence[Targets], grid: AnchorGrid) -> Losses:
    """The mean losses over the clouds of a batch."""
    parts = [_of_cloud(predictions, b, target, grid) for b, target in enumerate(targets)]
    return _weighted(torch.stack(parts).mean(0))


def cloud_losses(predictions: Predictions, b: int, target: Targets, grid: AnchorGrid) -> Losses:
    """The losses of cloud `b` of a batch."""
    return _weighted(_of_cloud(predictions, b, target, grid))


def _weighted(parts: Tensor) -> Losses:
    score, box, direction, quality = parts
    return Losses(
        SCORE_WEIGHT * score, BOX_WEIGHT * box, DIRECTION_WEIGHT * direction, QUALITY_WEIGHT * quality
    )


def _of_cloud(predictions: Predictions, b: int, target: Targets, grid: AnchorGrid) -> Tensor:
    count = max(1, len(target.positive))
    score = focal_loss(predictions.scores[b], target) / count
    anchors = grid.boxes(target.positive)
    target_code = encode_boxes(target.boxes, anchors)
    code = predictions.codes[b][target.positive]
    # The heading loss uses sin(difference), so that a box turned by pi has no loss here.
    turn = torch.sin(code[:, 6] - target_code[:, 6])
    difference = torch.cat([code[:, :6] - target_code[:, :6], turn[:, None]], dim=1)
    box = F.smooth_l1_loss(difference, torch.zeros_like(difference), reduction="sum", beta=BETA) / count
    bins = direction_bin(target.boxes[:, 6], grid.preset.direction_offset_rad)
    directions = predictions.directions[b][target.positive]
    direction = F.cross_entropy(directions, bins, reduction="sum") / count
    quality = score.new_zeros(())
    if predictions.qualities is not None:
        logits = predictions.qualities[b][target.positive]
        # The IoU target is detached: otherwise boxes would be made worse to match a low quality.
        iou = aligned_iou(decode_boxes(code.detach(), anchors), target.boxes)
        quality = F.binary_cross_entropy_with_logits(logits, iou, reduction="sum") / count
    return torch.stack([score, box, direction, quality])


def aligned_iou(boxes: Tensor, truth: Tensor) -> Tensor:
    """3D IoU (K,) of boxes (K, 7) with true ones (K, 7), as if both stood at the true heading."""
    c, s = torch.cos(truth[:, 6]), torch.sin(truth[:, 6])
    x, y, z = (boxes[:, :3] - truth[:, :3]).unbind(1)
    offset = torch.stack([c * x + s * y, c * y - s * x, z], dim=1)
    low = torch.maximum(offset - boxes[:, 3:6] / 2, -truth[:, 3:6] / 2)
    high = torch.minimum(offset + boxes[:, 3:6] / 2, truth[:, 3:6] / 2)
    common = (high - low).clamp(min=0).prod(1)
    return common / (boxes[:, 3:6].prod(1) + truth[:, 3:6].prod(1) - common)


def focal_loss(scores: Tensor, target: Targets) -> Tensor:
    """Sigmoid focal loss (Lin et al. 2017) of logits (N, classes), summed."""
    counted = torch.ones_like(scores)
    counted[target.ignored] = 0
    counted[target.positive, target.labels] = 0
    probability = torch.sigmoid(scores)
    background = ((1 - ALPHA) * counted * probability**GAMMA * F.softplus(scores)).sum()
    hit = scores[target.positive, target.labels]
    return background + (ALPHA * torch.sigmoid(-hit) ** GAMMA * F.softplus(-hit)).sum()


def direction_bin(yaw: Tensor, offset_rad: float) -> Tensor:
    """The half of the circle, counted from `offset_rad`, that contains a heading: 0 or 1."""
    turned = torch.remainder(yaw - offset_rad, 2 * pi)
    return (turned >= pi).long()
