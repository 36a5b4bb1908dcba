"""A detector of your own: clusters above the road are cars; --detector my_detector:ClusterDetector."""

import numpy as np
import torch
from scipy import ndimage

from advpipe import Detections, Range


class ClusterDetector:
    """Boxes around what stands 0.3 m to 2.1 m above the road, seen by a LiDAR 1.8 m above it."""

    classes = ("car",)  # some of car, truck, cyclist, pedestrian; labels index this tuple
    range_m = Range(-51.2, -51.2, -1.5, 51.2, 51.2, 0.3)  # nothing beyond is asked of it

    def detect(self, cloud):
        """Detections, best first, in a cloud (N,) with the fields x, y, z, intensity, ring, time."""
        xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1).astype(float)
        xyz = xyz[(np.abs(xyz[:, :2]) < 51.2).all(axis=1) & (xyz[:, 2] > -1.5) & (xyz[:, 2] < 0.3)]
        cells = ((xyz[:, :2] + 51.2) / 0.4).astype(int)  # of 0.4 m, in the bird's eye
        standing = np.zeros((256, 256), bool)
        standing[cells[:, 0], cells[:, 1]] = True
        cluster = ndimage.label(standing, np.ones((3, 3)))[0][cells[:, 0], cells[:, 1]]
        boxes = [self._box(xyz[cluster == k]) for k in np.flatnonzero(np.bincount(cluster) >= 20)]
        boxes = np.array([box for box in boxes if 3 < box[3] < 6 and box[4] < 2.5]).reshape(-1, 7)
        scores = np.exp(-np.abs(boxes[:, 3] - 4.5))  # the likelier, the closer to a car's usual length
        best = np.argsort(-scores, kind="stable")
        return Detections(boxes[best], scores[best], np.zeros(len(best), np.int64))

    def _box(self, xyz):
        """The smallest upright rectangle around the points, at least 1.7 m wide, down to the road."""
        turns = np.linspace(0, np.pi, 60, endpoint=False)
        axes = np.stack([np.cos(turns), np.sin(turns)])
        along, across = xyz[:, :2] @ axes, xyz[:, :2] @ np.stack([-axes[1], axes[0]])
        length, width = np.ptp(along, axis=0), np.ptp(across, axis=0)
        i = np.argmin(np.where(length >= width, length * width, np.inf))
        u, v = (part[:, i].min() + np.ptp(part[:, i]) / 2 for part in (along, across))
        x, y = u * axes[0, i] - v * axes[1, i], u * axes[1, i] + v * axes[0, i]
        return [x, y, -1.05, length[i], max(width[i], 1.7), 1.5, turns[i]]

    def loss(self, points, boxes, labels):
        """Large where boxes (M, 7) hold few points (N, 4): attacks follow its gradient to the points."""
        d = points[:, None, :3] - boxes[:, :3]
        c, s = torch.cos(boxes[:, 6]), torch.sin(boxes[:, 6])
        local = torch.stack([d[..., 0] * c + d[..., 1] * s, d[..., 1] * c - d[..., 0] * s, d[..., 2]], 2)
        inside = torch.sigmoid(10 * (boxes[:, 3:6] / 2 - local.abs())).prod(2)
        return torch.exp(-inside.sum(0) / 50).sum()
