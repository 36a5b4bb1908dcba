"""A small but real voxel detector, whose best removal a person can work out."""

from __future__ import annotations

import os
import signal

import numpy as np
import torch

from advpipe.pipeline.bag.cloud import xyzi
from advpipe.pipeline.detector.protocol import Detections, Range

BOX = [4.0, 5.0, 5.0, 6.0, 6.0, 6.0, 0.0]


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


class Shipped(LinearVoxelDetector):
    """The one that `load_detector("linear_detector:Shipped")` makes."""

    gradients = 0
    """How many gradients were asked for, by all instances: one a round."""

    def __init__(self):
        super().__init__(np.random.default_rng(9).uniform(0.1, 1, (10, 10, 10)), [BOX])

    def occupancy_loss(self, points, boxes, labels):
        Shipped.gradients += 1
        return super().occupancy_loss(points, boxes, labels)


class Interrupted(Shipped):
    """Ends its process like the user would in the third frame; of 10 rounds each."""

    def occupancy_loss(self, points, boxes, labels):
        if Shipped.gradients == 25:
            if "ATTACK_TEST_KILL" in os.environ:
                os.kill(os.getpid(), signal.SIGKILL)
            raise KeyboardInterrupt
        return super().occupancy_loss(points, boxes, labels)
