"""Detectors that fit a box to the points above the ground, the scene for them, and attacks on it."""

from __future__ import annotations

import numpy as np
import torch

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.messages.cloud import xyz, xyzi
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb

BOX = np.array([5.0, 5.0, 1.0, 4.0, 2.0, 1.6, 0.3])


class Framing:
    """Fits a box to the points that stand above the ground, as wide as they are: what is cut off or added at
    an end shortens or lengthens it. Its loss is a plain number, so that scores are all that it tells."""

    classes, range_m = ("car",), Range(0.0, 0.0, 0.0, 10.0, 10.0, 3.0)
    looks = 0

    def detect(self, cloud):
        self.looks += 1
        cos, sin = np.cos(BOX[6]), np.sin(BOX[6])
        box_R = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        place = (xyz(cloud).astype(float) - BOX[:3]) @ box_R
        mine = place[(np.abs(place) <= BOX[3:6] / 2 + 0.6).all(axis=1)]
        if not len(mine):
            return Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
        low, high = self.faces_m(mine)
        found = np.concatenate([BOX[:3] + box_R @ ((low + high) / 2), np.maximum(high - low, 0.1), BOX[6:]])
        brightness = 0.2 * (1 - np.clip(xyzi(cloud)[:, 3].mean(), 0, 1))
        score = np.clip(0.5 + 0.3 * np.exp(-np.abs(high - low - BOX[3:6]).sum()) + brightness, 0, 1)
        return Detections(found[None], np.array([score]), np.zeros(1, np.int64))

    def faces_m(self, points):
        return points.min(axis=0), points.max(axis=0)

    def loss(self, points, boxes, labels):
        return torch.tensor(1.0)


class Centred(Framing):
    """Puts a box of the right size about the mean of the points, which scattering them hardly moves."""

    def faces_m(self, points):
        return points.mean(axis=0) - BOX[3:6] / 2, points.mean(axis=0) + BOX[3:6] / 2


class Sloped(Framing):
    """With a gradient, which leads nowhere."""

    def loss(self, points, boxes, labels):
        return (points[:, :3] * torch.arange(1.0, 1.0 + len(points))[:, None]).sum()


def framed_car(make_cloud, make_boxes):
    """A cloud of a car and of points beside it, and the car's box."""
    draw = np.random.default_rng(2)
    on_car = draw.uniform(-0.5, 0.5, (300, 3)) * BOX[3:6]
    cos, sin = np.cos(BOX[6]), np.sin(BOX[6])
    on_car = on_car @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]).T + BOX[:3]
    cloud = make_cloud(np.concatenate([on_car, draw.uniform([0, 7.5, 0], [10, 10, 0.1], (300, 3))]))
    cloud["intensity"] = 0.5
    return cloud, make_boxes(BOX)


def strict_matches(detector, cloud, boxes):
    """How many objects the detector still finds at strict overlap."""
    return int((iou_3d(detector.detect(cloud).boxes, boxes.geometry) >= 0.7).sum())


ATTACKS = {
    "perturb": lambda **options: Perturb(eps_cm=30, **options),
    "detach": lambda **options: Detach(ratio=0.4, **options),
    "attach": lambda **options: Attach(eps_m=0.5, points=30, **options),
}


def rng(seed=0):
    return named_generator(seed, "test")
