"""The recipe `best` on PointPillars and CenterPoint, through their own occupancy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from advpipe.pipeline.detector.centerpoint.model import CenterPointNet
from advpipe.pipeline.detector.centerpoint.presets import SMALL as CENTRES
from advpipe.pipeline.detector.common.network import LabelledPoints
from advpipe.pipeline.detector.pointpillars.model import PointPillarsNet
from advpipe.pipeline.detector.pointpillars.presets import SMALL as PILLARS
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.metrics.average_precision import STRICT_IOU
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb

TINY = Range(-6.4, -6.4, -3.1, 6.4, 6.4, 2.3)
CAR = [3.0, 1.0, -1.0, 4.0, 2.0, 1.6, 0.0]
STEPS = 90
FAMILIES = {"pointpillars": (PointPillarsNet, PILLARS), "centerpoint": (CenterPointNet, CENTRES)}


def street_points():
    draw = np.random.default_rng(2)
    car = draw.uniform((1, 0, -1.8), (5, 2, -0.2), (150, 3))
    return np.concatenate([car, np.column_stack([draw.uniform(-6.3, 6.3, (300, 2)), np.full(300, -1.75)])])


@pytest.fixture(scope="module", params=FAMILIES)
def detector(request):
    """It has learned to find the car of the street."""
    build, preset = FAMILIES[request.param]
    torch.manual_seed(5)
    net = build(replace(preset, range_m=TINY)).train()
    for module in net.modules():
        if isinstance(module, (torch.nn.BatchNorm1d, torch.nn.BatchNorm2d)):
            module.momentum = 0.2  # it is a short training
    optimiser = torch.optim.AdamW(net.parameters(), lr=5e-3)
    points = torch.from_numpy(np.pad(street_points(), ((0, 0), (0, 1))).astype(np.float32))
    street = LabelledPoints(points, torch.tensor([CAR]), torch.tensor([0]))
    for step in range(STEPS):
        optimiser.param_groups[0]["lr"] = 5e-3 * (1 - step / STEPS)
        optimiser.zero_grad()
        torch.stack(net.training_losses(street)).sum().backward()
        optimiser.step()
    return net.detector({})


@pytest.mark.parametrize(
    "make",
    [
        lambda: Perturb(eps_cm=20, steps=4),
        lambda: Detach(ratio=0.1, rounds=3),
        lambda: Attach(eps_m=0.5, points=150, rounds=3),
    ],
    ids=["perturb", "detach", "attach"],
)
def test_best_harms_the_detection(detector, make_cloud, make_boxes, make):
    cloud = make_cloud(street_points())
    result = make()(cloud, make_boxes(CAR), detector, np.random.default_rng(1))
    assert "occupancy" not in result.note
    assert len(result.labels)
    # The detector was trained here, so that it differs a little from processor to processor.
    assert result.loss_after > 1.5 * result.loss_before
    assert overlap(detector, cloud) > max(STRICT_IOU["car"], overlap(detector, result.cloud))


def overlap(detector, cloud):
    """IoU of the car with the best box for it."""
    found = detector.detect(cloud)
    cars = found.boxes[found.labels == 0]
    return iou_3d(cars, np.array([CAR])).max(initial=0.0)
