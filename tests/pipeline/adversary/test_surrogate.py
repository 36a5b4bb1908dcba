"""A surrogate proposes changes, and the attacked detector decides."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from linear_detector import BOX, LinearVoxelDetector

from advpipe.pipeline.adversary.surrogate import ProposingDetector, SurrogateDetector, proposing
from advpipe.pipeline.detector.protocol import ObjectDetector, Range, VoxelDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

WEIGHTS = np.random.default_rng(9).uniform(0.1, 1, (10, 10, 10))


class Foreign:
    """Detects what another detector does, and has no more than a detector must have."""

    classes, range_m = ("cyclist", "car"), Range(0.0, 0.0, 0.0, 10.0, 10.0, 10.0)

    def __init__(self):
        self.inner = LinearVoxelDetector(WEIGHTS, [BOX])

    def detect(self, cloud):
        return self.inner.detect(cloud)

    def loss(self, points, boxes, labels):
        return torch.tensor(2.0)


@pytest.fixture
def attacked():
    return SurrogateDetector(Foreign(), LinearVoxelDetector(WEIGHTS, [BOX]))


def test_it_answers_as_the_attacked_detector(attacked):
    cloud = cloud_of_xyzi(np.random.default_rng(1).uniform(0, 10, (200, 4)).astype(np.float32))
    assert isinstance(attacked, ObjectDetector)
    assert not isinstance(attacked, VoxelDetector)
    assert attacked.classes == ("cyclist", "car")
    assert attacked.range_m == Foreign.range_m
    assert attacked.detect(cloud).scores.tolist() == Foreign().detect(cloud).scores.tolist()
    assert attacked.loss(None, None, None) == 2


def test_the_surrogate_gets_the_boxes_that_it_knows(attacked):
    """The car alone, with the surrogate's own label: not the cyclist, nor the car out of its range."""
    seen = proposing(attacked)
    assert isinstance(seen, VoxelDetector)
    points = torch.rand(50, 4) * 10
    boxes = torch.tensor([BOX, BOX, [90.0, *BOX[1:]]])
    alone = attacked.surrogate.occupancy_loss(points, boxes[:1], torch.tensor([0]))
    computed = seen.occupancy_loss(points, boxes, torch.tensor([1, 0, 1]))
    assert computed.loss == alone.loss
    assert computed.found is None
    assert seen.loss(points, boxes, torch.tensor([1, 0, 1])) == alone.loss
    assert seen.voxel_grid == attacked.surrogate.voxel_grid


def test_without_a_surrogate_nothing_proposes():
    assert proposing(Foreign()) is None
    assert isinstance(
        proposing(SurrogateDetector(Foreign(), LinearVoxelDetector(WEIGHTS, [BOX]))), ProposingDetector
    )
