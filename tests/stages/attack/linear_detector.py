"""A small but real voxel detector, whose best removal a person can work out."""

from __future__ import annotations

import os
import signal

import numpy as np
import torch

from advpipe.pipeline.detector.protocol import Detections, OccupancyLoss, Range, VoxelGrid
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyzi

BOX = [4.0, 5.0, 5.0, 6.0, 6.0, 6.0, 0.0]


class LinearVoxelDetector:
    """Voxels of 1 m in [0, 10)^3; an object's score is the sum of the weights of its occupied voxels.

    With mean points m_v, a box scores sum_v weight_v * occupancy_v * (1 + m_v.x / 100) over the voxels whose
    centre lies in it (boxes are not turned here). The loss is the scores of the anchors, which are background
    here, if there is no target, and else minus the scores of the targets.
    """

    classes = ("car",)
    range_m = Range(0.0, 0.0, 0.0, 10.0, 10.0, 10.0)

    def __init__(self, weights, anchors):
        self.weights = torch.as_tensor(weights, dtype=torch.float32)
        self.anchors = np.asarray(anchors, dtype=np.float64).reshape(-1, 7)

    voxel_grid = VoxelGrid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (10, 10, 10))

    def _scores(self, points, boxes, probes):
        given = torch.cat([points, probes])
        cells = torch.floor(given[:, :3].detach()).long()
        inside = ((cells >= 0) & (cells < 10)).all(dim=1)
        keys, rows = torch.unique((cells @ torch.tensor([100, 10, 1]))[inside], return_inverse=True)
        voxel = torch.full((len(given),), -1)
        voxel[inside] = rows
        holds_points = torch.zeros(len(keys), dtype=torch.bool)
        holds_points[voxel[: len(points)][inside[: len(points)]]] = True
        is_free = ~holds_points[voxel] if len(keys) else inside
        counts = inside & ((torch.arange(len(given)) < len(points)) | is_free)
        count = torch.bincount(voxel[counts], minlength=len(keys))
        mean_x = torch.zeros(len(keys)).index_add(0, voxel[counts], given[counts, 0]) / count
        occupancy = holds_points.float().requires_grad_()
        cells = torch.stack([keys // 100, keys // 10 % 10, keys % 10], dim=1)
        inside = ((cells[None] + 0.5 - boxes[:, None, :3]).abs() <= boxes[:, None, 3:6] / 2).all(dim=2)
        worth = self.weights[cells[:, 0], cells[:, 1], cells[:, 2]] * occupancy * (1 + mean_x / 100)
        return (worth * inside).sum(dim=1), occupancy, voxel

    def loss(self, points, boxes, labels):
        return self._loss(points, boxes, torch.zeros(0, 4))[0]

    def occupancy_loss(self, points, boxes, labels, probes=None):
        return OccupancyLoss(*self._loss(points, boxes, torch.zeros(0, 4) if probes is None else probes))

    def _loss(self, points, boxes, probes):
        judged = boxes if len(boxes) else torch.as_tensor(self.anchors, dtype=torch.float32)
        scores, occupancy, voxel = self._scores(points, judged, probes)
        return (-scores if len(boxes) else scores).sum(), occupancy, voxel

    def detect(self, cloud):
        boxes = torch.as_tensor(self.anchors, dtype=torch.float32)
        found = self._scores(torch.from_numpy(xyzi(cloud)), boxes, torch.zeros(0, 4))[0]
        scores = found.detach().numpy().astype(float)
        found = np.flatnonzero(scores > 0.5)
        return Detections(self.anchors[found], np.clip(scores[found], 0, 1), np.zeros(len(found), np.int64))


class Shipped(LinearVoxelDetector):
    """The one that `load_detector("linear_detector:Shipped")` makes."""

    gradients = 0
    """How many gradients were asked for, by all instances: one a round."""

    def __init__(self):
        super().__init__(np.random.default_rng(9).uniform(0.1, 1, (10, 10, 10)), [BOX])

    def occupancy_loss(self, *given):
        Shipped.gradients += torch.is_grad_enabled()
        return super().occupancy_loss(*given)


class Interrupted(Shipped):
    """Ends its process like the user would in the third frame; of 10 rounds each."""

    def occupancy_loss(self, *given):
        if Shipped.gradients == 25:
            if "ATTACK_TEST_KILL" in os.environ:
                os.kill(os.getpid(), signal.SIGKILL)
            raise KeyboardInterrupt
        return super().occupancy_loss(*given)


class Batched(Shipped):
    """It takes batches, and computes each cloud of one by itself: to the bit as if it were alone."""

    batches = 0
    """How many batches there were; the one of this number is never answered."""
    interrupted_at = -1

    def _each(self, answers):
        Batched.batches += 1
        if Batched.batches == Batched.interrupted_at:
            raise KeyboardInterrupt
        return answers

    def detect_batch(self, clouds):
        structured = [np.zeros(len(cloud), POINT_DTYPE) for cloud in clouds]
        for made, cloud in zip(structured, clouds, strict=True):
            for column, name in enumerate(("x", "y", "z", "intensity")):
                made[name] = cloud[:, column].numpy()
        return self._each([self.detect(cloud) for cloud in structured])

    def loss_batch(self, inputs):
        return self._each([self.loss(each.points, each.boxes, each.labels) for each in inputs])

    def occupancy_loss_batch(self, inputs):
        return self._each(
            [self.occupancy_loss(each.points, each.boxes, each.labels, each.probes) for each in inputs]
        )
