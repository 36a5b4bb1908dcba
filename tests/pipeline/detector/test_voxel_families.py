"""PointPillars and CenterPoint: gradients by finite differences, occupancy against really removing points."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import BatchDetector, LossInput
from advpipe.pipeline.messages.cloud import POINT_DTYPE

sys.path.insert(0, str(Path(__file__).parent))

from families import NETWORKS, small_detector

pytestmark = pytest.mark.usefixtures("still_iou")


@pytest.fixture(params=NETWORKS)
def detector(request):
    return small_detector(request.param)


@pytest.fixture
def given(detector, scene):
    """Points, boxes and labels in double precision, as the network is then too."""
    detector.net.double()
    return scene[0].double(), scene[1].double(), scene[2].clamp(max=len(detector.classes) - 1)


def loss_of(detector, voxels, boxes, labels, occupancy):
    points = torch.zeros(0, 4, dtype=torch.float64)
    (loss,) = detector._losses(detector.net(voxels, occupancy), [LossInput(points, boxes, labels)])
    return loss


def probes_of(detector, points, count=30):
    """Points in voxels without a point of the cloud."""
    grid, draw = detector.voxel_grid, np.random.default_rng(4)
    low, size = np.array(grid.low_m), np.array(grid.size_m) * grid.shape
    low[2], size[2] = -1.9, 2.0
    probes = np.column_stack([low + size * draw.random((600, 3)), draw.random(600)])
    taken = grid.keys(grid.cells(points.numpy()))
    mine = grid.keys(grid.cells(probes))
    probes = probes[(mine >= 0) & ~np.isin(mine, taken)]
    _, first = np.unique(grid.keys(grid.cells(probes)), return_index=True)
    return torch.from_numpy(probes[np.sort(first)][:count])


def test_each_is_a_batch_detector(detector):
    assert isinstance(detector, BatchDetector)


def test_gradient_to_the_points_matches_finite_differences(detector, given):
    points, boxes, labels = given
    leaf = points.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(detector.loss(leaf, boxes, labels), leaf)
    used = detector.occupancy_loss(points, boxes, labels).rows >= 0
    assert (gradient[used].abs().sum(1) > 0).double().mean() > 0.9
    torch.manual_seed(0)
    for _ in range(3):
        # Small enough to stay inside the voxels, and between most kinks.
        step = torch.randn_like(points) * 1e-8
        with torch.no_grad():
            change = detector.loss(points + step, boxes, labels) - detector.loss(points - step, boxes, labels)
        assert float(change) == pytest.approx(float(2 * (gradient * step).sum()), rel=1e-3)


def test_gradient_to_the_weights_matches_finite_differences(detector, given):
    detector.net.requires_grad_(True)
    weights = list(detector.net.parameters())
    gradients = torch.autograd.grad(detector.loss(*given), weights)
    torch.manual_seed(3)
    steps = [torch.randn_like(weight) * 1e-9 for weight in weights]
    losses = []
    with torch.no_grad():
        for sign in (1, -1):
            for weight, step in zip(weights, steps, strict=True):
                weight += sign * step
            losses.append(float(detector.loss(*given)))
            for weight, step in zip(weights, steps, strict=True):
                weight -= sign * step
    expected = 2 * sum(float((g * step).sum().detach()) for g, step in zip(gradients, steps, strict=True))
    assert losses[0] - losses[1] == pytest.approx(expected, rel=1e-3)


def test_full_occupancy_gives_the_plain_loss(detector, given):
    computed = detector.occupancy_loss(*given)
    assert computed.occupancy.is_leaf
    assert (computed.occupancy == 1).all()
    assert float(computed.loss.detach()) == pytest.approx(float(detector.loss(*given)), rel=1e-9)
    (gradient,) = torch.autograd.grad(computed.loss, computed.occupancy)
    assert (gradient != 0).double().mean() > 0.9


def test_zero_occupancy_equals_removing_the_points(detector, given):
    points, boxes, labels = given
    voxels = detector._voxels_of([points], [None])
    count = len(voxels.sites)
    torch.manual_seed(1)
    for removed in (torch.randperm(count)[:1], torch.randperm(count)[: count // 3], torch.arange(count - 5)):
        occupancy = torch.ones(count, dtype=torch.float64)
        occupancy[removed] = 0
        reduced = points[(voxels.point_to_voxel >= 0) & (occupancy[voxels.point_to_voxel] == 1)]
        expected = float(detector.loss(reduced, boxes, labels))
        assert float(loss_of(detector, voxels, boxes, labels, occupancy)) == pytest.approx(expected, rel=1e-9)


def test_occupancy_gradient_matches_finite_differences(detector, given):
    points, boxes, labels = given
    voxels = detector._voxels_of([points], [None])
    torch.manual_seed(2)
    occupancy = (0.5 + 0.5 * torch.rand(len(voxels.sites), dtype=torch.float64)).requires_grad_()
    (gradient,) = torch.autograd.grad(loss_of(detector, voxels, boxes, labels, occupancy), occupancy)
    step = torch.randn_like(occupancy) * 1e-8
    with torch.no_grad():
        raised = loss_of(detector, voxels, boxes, labels, occupancy + step)
        change = raised - loss_of(detector, voxels, boxes, labels, occupancy - step)
    assert float(change) == pytest.approx(float(2 * (gradient * step).sum()), rel=1e-3)


def test_probe_points_have_no_effect_at_zero_and_are_points_at_one(detector, given):
    points, boxes, labels = given
    probes = probes_of(detector, points)
    assert len(probes) > 15
    computed = detector.occupancy_loss(points, boxes, labels, probes)
    rows, plain = computed.rows[len(points) :], float(detector.loss(points, boxes, labels))
    assert (rows >= 0).all()
    assert not computed.occupancy[rows].any()
    assert float(computed.loss.detach()) == pytest.approx(plain, rel=1e-9)
    (gradient,) = torch.autograd.grad(computed.loss, computed.occupancy)
    assert (gradient[rows] != 0).double().mean() > 0.9
    voxels = detector._voxels_of([points], [probes])
    for raised in (rows[:1], rows):
        filled = computed.occupancy.detach().clone()
        filled[raised] = 1
        really = torch.cat([points, probes[torch.isin(rows, raised)]])
        expected = float(detector.loss(really, boxes, labels))
        assert float(loss_of(detector, voxels, boxes, labels, filled)) == pytest.approx(expected, rel=1e-9)


def test_a_batch_gives_what_its_clouds_give_alone(detector, given):
    points, boxes, labels = given
    probes = probes_of(detector, points)
    inputs = [
        LossInput(points, boxes, labels, probes),
        LossInput(points[::2], boxes[:1], labels[:1]),
        LossInput(points[:0], boxes, labels),
        LossInput(points + 50, boxes[:0], labels[:0], probes[:3]),
    ]
    together = detector.occupancy_loss_batch(inputs)
    plain = detector.loss_batch([replace(each, probes=None) for each in inputs])
    gradients = torch.autograd.grad([one.loss for one in together], [one.occupancy for one in together])
    for each, one, loss, gradient in zip(inputs, together, plain, gradients, strict=True):
        alone = detector.occupancy_loss(each.points, each.boxes, each.labels, each.probes)
        torch.testing.assert_close(one.loss, alone.loss, rtol=1e-9, atol=1e-12)
        torch.testing.assert_close(one.loss, loss, rtol=1e-9, atol=1e-12)
        assert torch.equal(one.rows, alone.rows)
        (expected,) = torch.autograd.grad(alone.loss, alone.occupancy)
        torch.testing.assert_close(gradient, expected, rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(one.found.boxes, detector.detect_batch([each.points])[0].boxes, atol=1e-9)


def test_the_voxel_grid_equals_the_networks_voxels(detector, scene):
    grid, rows = detector.voxel_grid, detector.occupancy_loss(*scene[:1], scene[1], scene[2] * 0).rows.numpy()
    keys = grid.keys(grid.cells(scene[0].numpy()))
    assert ((keys >= 0) == (rows >= 0)).all()
    assert len(np.unique(keys)) == len(np.unique(rows)) == len(np.unique(np.stack([keys, rows]), axis=1).T)


def cloud_of(points):
    cloud = np.zeros(len(points), POINT_DTYPE)
    for column, name in enumerate(("x", "y", "z", "intensity")):
        cloud[name] = points[:, column].numpy()
    return cloud


def test_detection_is_reproducible_and_ignores_points_that_are_not_finite(detector, scene):
    points = scene[0].clone()
    found = detector.detect(cloud_of(points))
    assert len(found) > 0
    assert (found.scores[:-1] >= found.scores[1:]).all()
    bad = torch.tensor([[float("nan"), 0.0, 0.0, 0.0], [0.0, float("inf"), 0.0, 0.0]])
    again = detector.detect(cloud_of(torch.cat([points, bad])))
    assert found.boxes.tobytes() == again.boxes.tobytes()
    with pytest.raises(AdvpipeError, match="not finite"):
        detector.loss(torch.cat([points, bad]), scene[1], scene[2] * 0)


@pytest.mark.parametrize(
    "points",
    [torch.zeros(0, 4), torch.full((5, 4), 1e6), torch.tensor([[1.0, 2.0, -1.0, 0.3]])],
    ids=["no points", "all out of range", "one point"],
)
def test_nearly_empty_clouds_are_processed(detector, scene, points):
    leaf, labels = points.clone().requires_grad_(), scene[2] * 0
    (gradient,) = torch.autograd.grad(detector.loss(leaf, scene[1], labels), leaf)
    assert torch.isfinite(gradient).all()
    if len(points) != 1:
        assert len(detector.detect(cloud_of(points))) == 0
        assert not gradient.any()
    computed = detector.occupancy_loss(points, scene[1], labels)
    assert len(computed.occupancy) == (len(points) == 1)
    assert torch.isfinite(computed.loss)
