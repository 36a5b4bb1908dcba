"""A small but real voxel detector, whose best removal a person can work out."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.bag.cloud import POINT_DTYPE, xyzi
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.geometry.boxes import Boxes


class LinearVoxelDetector:
    """Voxels of 1 m in [0, 10)^3; an object's score is the sum of the weights of its occupied voxels.

    With mean points m_v, the loss is -sum_v weight_v * occupancy_v * (1 + m_v.x / 100) over the voxels whose
    centre lies in a target box (boxes are not turned here).
    """

    classes = ("car",)
    range_m = Range(0.0, 0.0, 0.0, 10.0, 10.0, 10.0)

    def __init__(self, weights, anchors):
        self.weights = torch.as_tensor(weights, dtype=torch.float32)
        self.anchors = np.asarray(anchors, dtype=np.float64).reshape(-1, 7)
        self.checkpoint_sha256 = "0" * 64

    def _voxels(self, points):
        cells = torch.floor(points[:, :3].detach()).long()
        inside = ((cells >= 0) & (cells < 10)).all(dim=1)
        keys = (cells * torch.tensor([100, 10, 1])).sum(dim=1)
        occupied, rank = torch.unique(keys[inside], return_inverse=True)
        voxel = torch.full((len(points),), -1)
        voxel[inside] = rank
        return occupied, voxel

    def _scores(self, points, boxes, occupancy_of):
        occupied, voxel = self._voxels(points)
        cells = torch.stack([occupied // 100, occupied // 10 % 10, occupied % 10], dim=1)
        read = voxel >= 0
        count = torch.bincount(voxel[read], minlength=len(occupied))
        mean_x = torch.zeros(len(occupied)).index_add(0, voxel[read], points[read, 0]) / count
        occupancy = occupancy_of(len(occupied))
        inside = ((cells[None] + 0.5 - boxes[:, None, :3]).abs() <= boxes[:, None, 3:6] / 2).all(dim=2)
        worth = self.weights[cells[:, 0], cells[:, 1], cells[:, 2]] * occupancy * (1 + mean_x / 100)
        return (worth * inside).sum(dim=1), occupancy, voxel

    def loss(self, points, boxes, labels):
        return -self._scores(points, boxes, torch.ones)[0].sum()

    def occupancy_loss(self, points, boxes, labels):
        scores, occupancy, voxel = self._scores(
            points, boxes, lambda count: torch.ones(count, requires_grad=True)
        )
        return -scores.sum(), occupancy, voxel

    def detect(self, cloud):
        boxes = torch.as_tensor(self.anchors, dtype=torch.float32)
        scores = self._scores(torch.from_numpy(xyzi(cloud)), boxes, torch.ones)[0].numpy().astype(float)
        found = np.flatnonzero(scores > 0.5)
        return Detections(self.anchors[found], np.clip(scores[found], 0, 1), np.zeros(len(found), np.int64))


def cloud_of(points):
    cloud = np.zeros(len(points), POINT_DTYPE)
    if len(points):
        cloud["x"], cloud["y"], cloud["z"] = np.asarray(points, dtype=np.float32).T
    return cloud


def car(*geometries):
    geometry = np.asarray(geometries, dtype=np.float64).reshape(-1, 7)
    return Boxes(
        geometry,
        np.zeros(len(geometry), np.int64),
        tuple(f"car{i}" for i in range(len(geometry))),
        np.zeros((len(geometry), 3)),
    )


@pytest.fixture
def make_cloud():
    return cloud_of


@pytest.fixture
def make_boxes():
    return car


@pytest.fixture
def make_detector():
    return LinearVoxelDetector


@pytest.fixture
def hand_worked():
    """Voxels of a car at (0..3, 0, 0): A holds 1 point and weighs 4, B 3 points and 6, C 2 points and 9.

    Gain per point: C 4.5, A 4, B 2. Four points of clutter lie outside the box, one outside the range.
    """
    a = [[0.5, 0.5, 0.5]]
    b = [[1.2, 0.5, 0.5], [1.5, 0.5, 0.5], [1.8, 0.5, 0.5]]
    c = [[2.4, 0.5, 0.5], [2.6, 0.5, 0.5]]
    clutter = [[6.5, 6.5, 6.5], [6.6, 6.5, 6.5], [8.5, 1.5, 0.5], [50.0, 0.5, 0.5]]
    weights = np.ones((10, 10, 10))
    weights[0, 0, 0], weights[1, 0, 0], weights[2, 0, 0] = 4, 6, 9
    box = [1.5, 0.5, 0.5, 3.0, 1.0, 1.0, 0.0]
    return cloud_of(clutter[:2] + b + a + c + clutter[2:]), car(box), LinearVoxelDetector(weights, [box])
