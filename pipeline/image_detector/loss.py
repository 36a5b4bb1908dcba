"""The training loss: focal loss of the scores (CornerNet, Law and Deng 2018), and GIoU of the boxes."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from advpipe.pipeline.image_detector.network import Cells

LOSS_PARTS = ("score_loss", "box_loss")
BOX_WEIGHT = 2.0


def losses(cells: Cells, heat: Tensor, boxes_px: Tensor, weights: Tensor) -> Tensor:
    """The weighted parts (2,) of the loss of B pictures, in the order of `LOSS_PARTS`.

    heat: (B, C, h, w), boxes_px: (B, 4, h, w), weights: (B, h, w), see `Targets`.
    """
    return torch.stack(
        [score_loss(cells.logits, heat), BOX_WEIGHT * box_loss(cells.boxes_px, boxes_px, weights)]
    )


def score_loss(logits: Tensor, heat: Tensor) -> Tensor:
    """Penalty-reduced focal loss, divided by the number of middles; cells whose heat is NaN are left out."""
    score = torch.sigmoid(logits)
    is_middle = (heat == 1).to(logits.dtype)
    nothing = (1 - torch.nan_to_num(heat, nan=1.0)) ** 4
    found = (1 - score) ** 2 * logsigmoid(logits) * is_middle
    empty = score**2 * logsigmoid(-logits) * nothing
    return -(found + empty).sum() / is_middle.sum().clamp(min=1.0)


def box_loss(boxes_px: Tensor, wanted_px: Tensor, weights: Tensor) -> Tensor:
    """The mean of 1 - GIoU (Rezatofighi et al. 2019) over the cells that learn a box, by their weights."""
    left, top, right, bottom = boxes_px.unbind(1)
    left_, top_, right_, bottom_ = wanted_px.unbind(1)
    shared = (torch.minimum(right, right_) - torch.maximum(left, left_)).clamp(min=0) * (
        torch.minimum(bottom, bottom_) - torch.maximum(top, top_)
    ).clamp(min=0)
    union = (right - left) * (bottom - top) + (right_ - left_) * (bottom_ - top_) - shared
    hull = (torch.maximum(right, right_) - torch.minimum(left, left_)) * (
        torch.maximum(bottom, bottom_) - torch.minimum(top, top_)
    )
    giou = shared / union.clamp(min=1e-6) - (hull - union) / hull.clamp(min=1e-6)
    return ((1 - giou) * weights).sum() / weights.sum().clamp(min=1.0)
