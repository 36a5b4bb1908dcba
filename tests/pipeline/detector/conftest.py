"""What the tests of several families share."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.detector.common import loss


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
