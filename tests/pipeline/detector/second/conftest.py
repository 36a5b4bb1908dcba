from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from advpipe.pipeline.detector.common import loss
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL

TINY = replace(SMALL, name="tiny", range_m=Range(-6.4, -6.4, -3.1, 6.4, 6.4, 2.3))
"""`small` over an eighth of the width: the same layers, a sixty-fourth of the map."""


@pytest.fixture
def tiny() -> Second:
    """A network of random weights whose batch norms have seen something."""
    torch.manual_seed(5)
    net = SecondNet(TINY)
    for module in net.modules():
        if isinstance(module, (torch.nn.BatchNorm1d, torch.nn.BatchNorm2d)):
            torch.nn.init.uniform_(module.weight, 0.7, 1.3)
            torch.nn.init.uniform_(module.bias, -0.3, 0.5)
            torch.nn.init.uniform_(module.running_mean, -0.2, 0.2)
            torch.nn.init.uniform_(module.running_var, 0.3, 1.0)
    torch.nn.init.normal_(net.head.convolution.weight, std=0.1)
    return Second(net)


@pytest.fixture
def scene() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Ground, a car and a pedestrian: points (N, 4), boxes (2, 7), labels (2,)."""
    rng = np.random.default_rng(0)
    boxes = np.array([[3.0, 1.0, -1.0, 4.5, 1.8, 1.6, 0.4], [-3.0, -2.0, -0.9, 0.8, 0.7, 1.8, 2.0]])
    ground = np.column_stack([rng.uniform(-6.3, 6.3, (400, 2)), np.full(400, -1.75)])
    things = [b[:3] + rng.uniform(-0.5, 0.5, (150, 3)) * b[3:6] for b in boxes]
    xyz = np.concatenate([ground, *things])
    points = np.column_stack([xyz, rng.uniform(0, 1, len(xyz))])
    return (
        torch.from_numpy(points.astype(np.float32)),
        torch.from_numpy(boxes.astype(np.float32)),
        torch.tensor([0, 3]),
    )


@pytest.fixture
def still_iou(monkeypatch):
    """The IoU that a box's quality is judged by is a constant to the gradient: one to the differences too."""
    monkeypatch.setattr(loss, "aligned_iou", lambda boxes, truth: torch.full_like(boxes[:, 0], 0.6))
