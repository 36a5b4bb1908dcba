"""Gradients, also of what a loss does not depend on; and attacks on detectors that have none."""

from __future__ import annotations

import pytest
import torch
from linear_detector import LinearVoxelDetector

from advpipe.pipeline.adversary.gradient import gradients_of
from advpipe.pipeline.core.seeding import named_generator
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb


class Blind(LinearVoxelDetector):
    """Its losses are plain numbers."""

    def loss(self, points, boxes, labels):
        return super().loss(points, boxes, labels).detach()

    def occupancy_loss(self, points, boxes, labels, probes=None):
        loss, occupancy, voxel = super().occupancy_loss(points, boxes, labels, probes)
        return loss.detach(), occupancy, voxel


def test_zero_where_the_loss_does_not_depend_on_it():
    a, b = torch.ones(3, requires_grad=True), torch.ones(2, requires_grad=True)
    of_a, of_b = gradients_of((a**2).sum(), a, b)
    assert of_a.tolist() == [2, 2, 2]
    assert of_b.tolist() == [0, 0]
    (of_nothing,) = gradients_of(torch.tensor(3.0), a)
    assert of_nothing.tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    "attack",
    [
        lambda recipe: Detach(ratio=0.25, recipe=recipe),
        lambda recipe: Perturb(eps_cm=10, recipe=recipe),
        lambda recipe: Attach(eps_m=0.5, points=4, recipe=recipe),
    ],
)
@pytest.mark.parametrize("recipe", ["best", "paper"])
def test_a_loss_without_any_gradient_is_said(attack, recipe, hand_worked):
    cloud, boxes, detector = hand_worked
    blind = Blind(detector.weights, detector.anchors)
    result = attack(recipe)(cloud, boxes, blind, named_generator(0, "test"))
    assert "no gradient" in result.note
    assert len(result.labels) == 0
