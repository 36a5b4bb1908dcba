"""Several clouds in one pass: each as if it were alone, up to rounding (of doubles)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import BatchDetector, LossInput
from advpipe.pipeline.detector.second.model import Second

CLOSE = {"rtol": 1e-9, "atol": 1e-12}


def inputs_of(scene) -> list[LossInput]:
    """Clouds that differ: with probes, without; without objects; without points; out of range."""
    points, boxes, labels = scene[0].double(), scene[1].double(), scene[2]
    shifted, probes = points.clone(), points[:40] + points.new_tensor([0.0, 0.0, 0.5, 0.0])
    shifted[:, 0] = -shifted[:, 0]
    return [
        LossInput(points, boxes, labels, probes),
        LossInput(shifted[:300], boxes[:1], labels[:1]),
        LossInput(points[::2], boxes[:0], labels[:0], probes[:7]),
        LossInput(points[:0], boxes, labels),
        LossInput(points + 50, boxes, labels),
        LossInput(points[:0], boxes, labels, probes),
        LossInput(points, boxes, labels),
    ]


def leaves_of(inputs: list[LossInput]) -> list[LossInput]:
    return [replace(each, points=each.points.clone().requires_grad_()) for each in inputs]


def test_second_is_a_batch_detector(tiny: Second) -> None:
    assert isinstance(tiny, BatchDetector)


@pytest.fixture
def double(tiny: Second) -> Second:
    tiny.net.double()
    return tiny


def test_losses_and_gradients_equal_those_of_single_clouds(double: Second, scene) -> None:
    batch, alone = leaves_of(inputs_of(scene)), leaves_of(inputs_of(scene))
    found = double.loss_batch(batch)
    gradients = torch.autograd.grad(found, [each.points for each in batch])
    for each, loss, gradient in zip(alone, found, gradients, strict=True):
        wanted = double.loss(each.points, each.boxes, each.labels)
        torch.testing.assert_close(loss, wanted, **CLOSE)
        torch.testing.assert_close(gradient, torch.autograd.grad(wanted, each.points)[0], **CLOSE)
    assert [bool(gradient.any()) for gradient in gradients] == [True, True, True, False, False, False, True]


def test_occupancies_with_probe_points_equal_those_of_single_clouds(double: Second, scene) -> None:
    batch, alone = leaves_of(inputs_of(scene)), leaves_of(inputs_of(scene))
    found = double.occupancy_loss_batch(batch)
    leaves = [leaf for each, one in zip(batch, found, strict=True) for leaf in (each.points, one.occupancy)]
    gradients = iter(torch.autograd.grad([one.loss for one in found], leaves))
    for each, one in zip(alone, found, strict=True):
        wanted = double.occupancy_loss(each.points, each.boxes, each.labels, each.probes)
        assert one.occupancy.is_leaf
        torch.testing.assert_close(one.loss, wanted.loss, **CLOSE)
        assert torch.equal(one.occupancy, wanted.occupancy)
        assert torch.equal(one.rows, wanted.rows)
        np.testing.assert_allclose(one.found.boxes, double.detect_batch([each.points])[0].boxes, atol=1e-9)
        for gradient in torch.autograd.grad(wanted.loss, [each.points, wanted.occupancy]):
            torch.testing.assert_close(next(gradients), gradient, **CLOSE)


def test_points_that_are_not_finite_are_refused(double: Second, scene) -> None:
    inputs = inputs_of(scene)
    inputs[1].points[3, 2] = torch.nan
    for ask in (double.loss_batch, double.occupancy_loss_batch):
        with pytest.raises(AdvpipeError, match="not finite"):
            ask(inputs)
