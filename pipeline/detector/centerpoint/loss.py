"""The loss of a centre head: focal heat (Law and Deng 2018), L1 boxes, and the quality of boxes."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.detector.centerpoint.head import CentrePredictions
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid, CentreTargets
from advpipe.pipeline.detector.common import loss as anchor_loss

HEAT_WEIGHT, BOX_WEIGHT, QUALITY_WEIGHT = 1.0, 2.0, 0.5
CENTRE_LOSS_PARTS = ("heat_loss", "box_loss", "quality_loss")
GAMMA, BETA = 2, 4
"""Exponents of the focal heat loss: of the error, and of how far a target is below 1."""


def centre_losses(
    predictions: CentrePredictions, b: int, target: CentreTargets, grid: CentreGrid
) -> tuple[Tensor, ...]:
    """The weighted parts of cloud `b`, in the order of `CENTRE_LOSS_PARTS`: the heat's for each object, the
    others means over the cells that learn a box, weighted by their heat."""
    heat = focal_heat_loss(predictions.scores[b], target)
    share = target.weights / target.weights.sum().clamp(min=1.0)
    code = predictions.codes[b][target.cells]
    box = (share[:, None] * (code - grid.encode(target.boxes, target.cells)).abs()).sum()
    if grid.preset.overlap_weight:
        overlap = anchor_loss.aligned_iou(grid.decode(code, target.cells), target.boxes)
        box = box + grid.preset.overlap_weight * (share * (1 - overlap)).sum()
    quality = heat.new_zeros(())
    if predictions.qualities is not None:
        logits = predictions.qualities[b][target.cells]
        # The IoU target is detached: otherwise boxes would be made worse to match a low quality.
        iou = anchor_loss.aligned_iou(grid.decode(code.detach(), target.cells), target.boxes)
        quality = F.binary_cross_entropy_with_logits(logits, iou, weight=share, reduction="sum")
    return HEAT_WEIGHT * heat, BOX_WEIGHT * box, QUALITY_WEIGHT * quality


def focal_heat_loss(scores: Tensor, target: CentreTargets) -> Tensor:
    """The loss of logits (N, classes), normalised by the number of peaks."""
    probability, is_peak = torch.sigmoid(scores), target.heat == 1
    background = (target.counted & ~is_peak) * (1 - target.heat) ** BETA
    missed = (is_peak * (1 - probability) ** GAMMA * F.softplus(-scores)).sum()
    false = (background * probability**GAMMA * F.softplus(scores)).sum()
    return (missed + false) / is_peak.sum().clamp(min=1)
