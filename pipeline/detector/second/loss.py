"""The training loss of SECOND: focal classification, smooth L1 boxes, direction (Yan et al. 2018)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.detector.second.anchors import AnchorGrid, Targets, encode
from advpipe.pipeline.detector.second.head import Predictions

SCORE_WEIGHT, BOX_WEIGHT, DIRECTION_WEIGHT = 1.0, 2.0, 0.2
ALPHA, GAMMA = 0.25, 2
BETA = 1 / 9


@dataclass(frozen=True)
class Losses:
    """The weighted parts, scalars, each normalised by the positive anchors of its cloud."""

    score: Tensor
    box: Tensor
    direction: Tensor

    @property
    def total(self) -> Tensor:
        return self.score + self.box + self.direction


def losses(predictions: Predictions, targets: Sequence[Targets], grid: AnchorGrid) -> Losses:
    """The mean losses over the clouds of a batch."""
    parts = [
        _of_cloud(predictions.scores[b], predictions.codes[b], predictions.directions[b], target, grid)
        for b, target in enumerate(targets)
    ]
    score, box, direction = torch.stack(parts).mean(0)
    return Losses(SCORE_WEIGHT * score, BOX_WEIGHT * box, DIRECTION_WEIGHT * direction)


def _of_cloud(scores: Tensor, codes: Tensor, directions: Tensor, target: Targets, grid: AnchorGrid) -> Tensor:
    count = max(1, len(target.positive))
    score = focal_loss(scores, target) / count
    anchors = grid.boxes(target.positive)
    wanted = encode(target.boxes, anchors)
    code = codes[target.positive]
    # The heading counts as sin(difference), so that a box turned by pi costs nothing here.
    turn = torch.sin(code[:, 6] - wanted[:, 6])
    difference = torch.cat([code[:, :6] - wanted[:, :6], turn[:, None]], dim=1)
    box = F.smooth_l1_loss(difference, torch.zeros_like(difference), reduction="sum", beta=BETA) / count
    bins = direction_bin(target.boxes[:, 6], grid.preset.direction_offset_rad)
    direction = F.cross_entropy(directions[target.positive], bins, reduction="sum") / count
    return torch.stack([score, box, direction])


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
    """Which half of the circle, counted from `offset_rad`, a heading lies in: 0 or 1."""
    turned = torch.remainder(yaw - offset_rad, 2 * pi)
    return (turned >= pi).long()
