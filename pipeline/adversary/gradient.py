"""Gradients of a detector's loss, zero where the loss does not depend on the input."""

from __future__ import annotations

import torch
from torch import Tensor


class NoGradientError(Exception):
    """The detector's loss does not depend on any point."""


def gradients_of(loss: Tensor, *leaves: Tensor) -> list[Tensor]:
    """dL/dleaf for each of the leaves, in one backward pass; zero where the loss does not depend on it."""
    if not loss.requires_grad:
        return [torch.zeros_like(leaf) for leaf in leaves]
    return list(torch.autograd.grad(loss, leaves, allow_unused=True, materialize_grads=True))
