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
    return _weighted(_of_clouds(predictions, targets, grid).mean(0))


def cloud_losses(predictions: Predictions, b: int, target: Targets, grid: AnchorGrid) -> Losses:
    """The losses of cloud `b` of a batch."""
    return _weighted(_of_clouds(predictions.of_cloud(b), [target], grid)[0])


def _weighted(parts: Tensor) -> Losses:
    score, box, direction, quality = parts
    return Losses(
        SCORE_WEIGHT * score, BOX_WEIGHT * box, DIRECTION_WEIGHT * direction, QUALITY_WEIGHT * quality
    )


def _of_clouds(predictions: Predictions, targets: Sequence[Targets], grid: AnchorGrid) -> Tensor:
    """The parts of the loss (B, 4) of each cloud, normalised by its positive anchors, not yet weighted."""
    clouds, device = len(predictions.scores), predictions.scores.device
    counts = [len(target.positive) for target in targets]
    cloud_of = torch.repeat_interleave(
        torch.arange(clouds, device=device), torch.tensor(counts, device=device), output_size=sum(counts)
    )
    normal = torch.tensor([1 / max(1, count) for count in counts], device=device)

    def per_cloud(of_positives: Tensor) -> Tensor:
        """Values (P,) of the positive anchors, summed by cloud (B,)."""
        return normal * of_positives.new_zeros(clouds).index_add(0, cloud_of, of_positives)

    positive = torch.cat([target.positive for target in targets])
    anchors = grid.boxes(positive)
    boxes = torch.cat([target.boxes for target in targets])
    target_code = encode_boxes(boxes, anchors)
    code = predictions.codes[cloud_of, positive]
    # The heading loss uses sin(difference), so that a box turned by pi has no loss here.
    turn = torch.sin(code[:, 6] - target_code[:, 6])
    difference = torch.cat([code[:, :6] - target_code[:, :6], turn[:, None]], dim=1)
    box = F.smooth_l1_loss(difference, torch.zeros_like(difference), reduction="none", beta=BETA).sum(1)
    preset = grid.preset
    if preset.overlap_weight:
        box = box + preset.overlap_weight * (1 - aligned_iou(decode_boxes(code, anchors), boxes))
    bins = direction_bin(boxes[:, 6], preset.direction_offset_rad)
    direction = F.cross_entropy(predictions.directions[cloud_of, positive], bins, reduction="none")
    quality = code.new_zeros(len(code))
    if predictions.qualities is not None:
        logits = predictions.qualities[cloud_of, positive]
        # The IoU target is detached: otherwise boxes would be made worse to match a low quality.
        iou = aligned_iou(decode_boxes(code.detach(), anchors), boxes)
        quality = F.binary_cross_entropy_with_logits(logits, iou, reduction="none")
    background, hit = focal_losses(predictions.scores, targets, cloud_of)
    score = normal * background + per_cloud(hit)
    return torch.stack([score, *map(per_cloud, (box, direction, quality))], dim=1)


def aligned_iou(boxes: Tensor, truth: Tensor) -> Tensor:
    """3D IoU (K,) of boxes (K, 7) with true ones (K, 7), as if both stood at the true heading."""
    c, s = torch.cos(truth[:, 6]), torch.sin(truth[:, 6])
    x, y, z = (boxes[:, :3] - truth[:, :3]).unbind(1)
    offset = torch.stack([c * x + s * y, c * y - s * x, z], dim=1)
    low = torch.maximum(offset - boxes[:, 3:6] / 2, -truth[:, 3:6] / 2)
    high = torch.minimum(offset + boxes[:, 3:6] / 2, truth[:, 3:6] / 2)
    common = _volume(torch.relu(high - low))
    return common / (_volume(boxes[:, 3:6]) + _volume(truth[:, 3:6]) - common)


def _volume(sizes: Tensor) -> Tensor:
    """Of boxes of these sizes (K, 3); `prod` would divide by them in its gradient."""
    length, width, height = sizes.unbind(1)
    return length * width * height


def focal_losses(scores: Tensor, targets: Sequence[Targets], cloud_of: Tensor) -> tuple[Tensor, Tensor]:
    """Sigmoid focal loss (Lin et al. 2017) of logits (B, N, classes): the sums (B,) over the background of
    each cloud, and the values (P,) of the positive anchors, whose clouds are `cloud_of` (P,)."""
    positive = torch.cat([target.positive for target in targets])
    labels = torch.cat([target.labels for target in targets])
    counted = torch.ones_like(scores)
    for b, target in enumerate(targets):
        counted[b, target.ignored] = 0
    counted[cloud_of, positive, labels] = 0
    probability = torch.sigmoid(scores)
    background = (1 - ALPHA) * counted * probability**GAMMA * F.softplus(scores)
    hit = scores[cloud_of, positive, labels]
    return background.flatten(1).sum(1), ALPHA * torch.sigmoid(-hit) ** GAMMA * F.softplus(-hit)


def direction_bin(yaw: Tensor, offset_rad: float) -> Tensor:
    """The half of the circle, counted from `offset_rad`, that contains a heading: 0 or 1."""
    turned = torch.remainder(yaw - offset_rad, 2 * pi)
    return (turned >= pi).long()
