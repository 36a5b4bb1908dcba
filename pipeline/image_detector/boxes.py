"""Overlap of boxes in an image, and the suppression of those that overlap a better one."""

from __future__ import annotations

import torch
from torch import Tensor

SAME_OBJECT = 0.5
"""IoU from which on two boxes of one class are taken for the same object."""


def pairwise_iou(boxes_px: Tensor, others_px: Tensor) -> Tensor:
    """IoU (N, M) of boxes (N, 4) with others (M, 4), left, top, right, bottom; 0 for a pair without area."""
    low = torch.maximum(boxes_px[:, None, :2], others_px[None, :, :2])
    high = torch.minimum(boxes_px[:, None, 2:], others_px[None, :, 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    areas = (boxes_px[:, 2:] - boxes_px[:, :2]).prod(-1), (others_px[:, 2:] - others_px[:, :2]).prod(-1)
    union = areas[0][:, None] + areas[1][None] - shared
    return torch.where(union > 0, shared / union.clamp(min=1e-9), 0.0)


def best_of_each(boxes_px: Tensor, labels: Tensor, min_iou: float = SAME_OBJECT) -> Tensor:
    """Indices (K,) of the boxes (N, 4), best first, that overlap no better one of their class (N,)."""
    overlaps = (pairwise_iou(boxes_px, boxes_px) >= min_iou) & (labels[:, None] == labels[None])
    kept: list[int] = []
    is_left = torch.ones(len(boxes_px), dtype=torch.bool)
    for index in range(len(boxes_px)):
        if is_left[index]:
            kept.append(index)
            is_left &= ~overlaps[index]
    return torch.tensor(kept, dtype=torch.int64)
