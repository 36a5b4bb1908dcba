"""Batch norms of untrained networks."""

from __future__ import annotations

import torch


def draw_batch_norms(net: torch.nn.Module) -> None:
    """Random parameters and statistics, as if the batch norms had seen something."""
    for module in net.modules():
        if isinstance(module, (torch.nn.BatchNorm1d, torch.nn.BatchNorm2d)):
            torch.nn.init.uniform_(module.weight, 0.7, 1.3)
            torch.nn.init.uniform_(module.bias, -0.3, 0.5)
            torch.nn.init.uniform_(module.running_mean, -0.2, 0.2)
            torch.nn.init.uniform_(module.running_var, 0.3, 1.0)
