"""The whole network: gradients by finite differences, occupancy against really removing points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common import decode
from advpipe.pipeline.detector.common.voxels import voxelise
from advpipe.pipeline.detector.protocol import LossInput, Range, VoxelDetector
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import KITTI, SMALL
from advpipe.pipeline.messages.cloud import POINT_DTYPE


def voxels_of(detector, points, probes=None):
    return detector._voxels_of([points], [probes])


def loss_of(detector, voxels, boxes, labels, occupancy):
    (loss,) = detector._losses(detector.net(voxels, occupancy), [LossInput(voxels.features, boxes, labels)])
    return loss


def cloud_of(points: torch.Tensor) -> np.ndarray:
    cloud = np.zeros(len(points), POINT_DTYPE)
    for column, name in enumerate(("x", "y", "z", "intensity")):
        cloud[name] = points[:, column].numpy()
    return cloud


def test_small_has_the_documented_number_of_parameters():
    assert sum(p.numel() for p in SecondNet(SMALL).parameters()) == 1_393_496


def test_second_is_a_voxel_detector(tiny):
    assert isinstance(tiny, VoxelDetector)


def test_gradient_to_the_points_matches_finite_differences(tiny, scene, still_iou):
    tiny.net.double()
    points, boxes, labels = scene[0].double().requires_grad_(), scene[1].double(), scene[2]
    (gradient,) = torch.autograd.grad(tiny.loss(points, boxes, labels), points)
    assert (gradient[:, :3].abs().sum(1) > 0).float().mean() > 0.9
    torch.manual_seed(0)
    for _ in range(3):
        # Small enough to stay inside the voxels.
        step = torch.randn_like(points) * 1e-7
        with torch.no_grad():
            change = tiny.loss(points + step, boxes, labels) - tiny.loss(points - step, boxes, labels)
        assert float(change) == pytest.approx(float(2 * (gradient * step).sum()), rel=1e-3)


def test_gradient_to_the_weights_matches_finite_differences(tiny, scene, still_iou):
    tiny.net.double().requires_grad_(True)
    points, boxes, labels = scene[0].double(), scene[1].double(), scene[2]
    weights = dict(tiny.net.named_parameters())
    gradients = torch.autograd.grad(tiny.loss(points, boxes, labels), list(weights.values()))
    torch.manual_seed(3)
    for (name, weight), gradient in zip(weights.items(), gradients, strict=True):
        step = torch.randn_like(weight)
        step *= 1e-8 / step.norm()  # small enough to cross few kinks of the ReLUs
        with torch.no_grad():
            weight += step
            change = tiny.loss(points, boxes, labels)
            weight -= 2 * step
            change -= tiny.loss(points, boxes, labels)
            weight += step
        expected = float(2 * (gradient * step).sum())
        assert float(change) == pytest.approx(expected, rel=2e-3, abs=1e-14), name


def test_gradient_steps_lower_the_loss(tiny, scene):
    points, boxes, labels = scene
    moved = points.clone()
    before = float(tiny.loss(points, boxes, labels))
    for _ in range(10):
        moved.requires_grad_()
        (gradient,) = torch.autograd.grad(tiny.loss(moved, boxes, labels), moved)
        moved = (moved - 0.01 * gradient / gradient.abs().max()).detach()
    assert float(tiny.loss(moved, boxes, labels)) < before


def test_full_occupancy_gives_the_plain_loss(tiny, scene):
    computed = tiny.occupancy_loss(*scene)
    loss, occupancy, point_to_voxel = computed.loss, computed.occupancy, computed.rows
    assert occupancy.is_leaf
    assert (occupancy == 1).all()
    assert len(point_to_voxel) == len(scene[0])
    assert int(point_to_voxel.max()) == len(occupancy) - 1
    assert float(loss.detach()) == pytest.approx(float(tiny.loss(*scene)), rel=1e-6)
    (gradient,) = torch.autograd.grad(loss, occupancy)
    assert gradient.shape == occupancy.shape
    assert (gradient != 0).float().mean() > 0.9


def test_zero_occupancy_equals_removing_the_points(tiny, scene):
    points, boxes, labels = scene
    voxels = voxels_of(tiny, points)
    count = len(voxels.sites)
    torch.manual_seed(1)
    for removed in (torch.randperm(count)[:1], torch.randperm(count)[: count // 3], torch.arange(count - 5)):
        occupancy = torch.ones(count)
        occupancy[removed] = 0
        masked = loss_of(tiny, voxels, boxes, labels, occupancy)
        reduced = points[occupancy[voxels.point_to_voxel] == 1]
        assert float(masked) == pytest.approx(float(tiny.loss(reduced, boxes, labels)), rel=1e-4)


def test_occupancy_gradient_matches_finite_differences(tiny, scene, still_iou):
    tiny.net.double()
    points, boxes, labels = scene[0].double(), scene[1].double(), scene[2]
    voxels = voxels_of(tiny, points)
    torch.manual_seed(2)
    occupancy = (0.5 + 0.5 * torch.rand(len(voxels.sites), dtype=torch.float64)).requires_grad_()
    (gradient,) = torch.autograd.grad(loss_of(tiny, voxels, boxes, labels, occupancy), occupancy)
    step = torch.randn_like(occupancy) * 1e-7
    with torch.no_grad():
        raised = loss_of(tiny, voxels, boxes, labels, occupancy + step)
        change = raised - loss_of(tiny, voxels, boxes, labels, occupancy - step)
    assert float(change) == pytest.approx(float(2 * (gradient * step).sum()), rel=1e-3)


@pytest.fixture
def kitti(tiny, scene):
    """A piece of `kitti`, whose voxels hold five points and clouds so many voxels at most."""
    piece = replace(KITTI, range_m=Range(-6.4, -6.4, -3.0, 6.4, 6.4, 1.0))
    piece = replace(piece, max_voxels=len(voxelise(scene[:1], replace(piece, max_voxels=None)).sites) + 60)
    torch.manual_seed(6)
    net = SecondNet(piece)
    torch.nn.init.normal_(net.head.convolution.weight, std=0.05)
    return Second(net)


def probes_of(detector, points, count=40):
    """Points in voxels beside those of `points`, none in one of them."""
    grid = detector.voxel_grid
    draw = np.random.default_rng(4)
    candidates = points.repeat(20, 1)[torch.from_numpy(draw.permutation(20 * len(points)))]
    candidates[:, :3] += torch.from_numpy(draw.uniform(-0.15, 0.15, (len(candidates), 3)))
    taken = grid.keys(grid.cells(points.numpy()))
    mine = grid.keys(grid.cells(candidates.numpy()))
    return candidates[torch.from_numpy((mine >= 0) & ~np.isin(mine, taken))][:count]


@pytest.mark.parametrize("name", ["tiny", "kitti"])
def test_probe_points_have_no_effect_at_zero_and_are_points_at_one(request, scene, name):
    detector = request.getfixturevalue(name)
    points, boxes, labels = scene
    labels = labels.clamp(max=len(detector.classes) - 1)
    probes = probes_of(detector, points)
    computed = detector.occupancy_loss(points, boxes, labels, probes)
    loss, occupancy, row_of = computed.loss, computed.occupancy, computed.rows
    assert occupancy.is_leaf
    rows = row_of[len(points) :].unique()
    read = rows[rows >= 0]
    assert len(read) > 20
    assert not occupancy[read].any()
    assert int(occupancy.sum()) == len(occupancy) - len(read)
    assert float(loss.detach()) == pytest.approx(float(detector.loss(points, boxes, labels)), rel=1e-5)
    (gradient,) = torch.autograd.grad(loss, occupancy)
    assert (gradient[read] != 0).float().mean() > 0.9
    voxels = voxels_of(detector, points, probes)
    for raised in (read[:1], read):
        filled = occupancy.detach().clone()
        filled[raised] = 1
        really = torch.cat([points, probes[torch.isin(row_of[len(points) :], raised)]])
        expected = float(detector.loss(really, boxes, labels))
        assert float(loss_of(detector, voxels, boxes, labels, filled)) == pytest.approx(expected, rel=1e-5)


def test_kitti_ignores_probe_points_beyond_its_voxels(kitti, scene):
    probes = probes_of(kitti, scene[0], 400)
    computed = kitti.occupancy_loss(scene[0], scene[1], scene[2].clamp(max=2), probes)
    occupancy, row_of = computed.occupancy, computed.rows
    assert len(occupancy) == kitti.preset.max_voxels
    assert (row_of[: len(scene[0])] >= 0).all()
    assert (row_of[len(scene[0]) :] < 0).any()


@pytest.mark.parametrize("name", ["tiny", "kitti"])
def test_gradient_to_probe_points_matches_finite_differences(request, scene, still_iou, name):
    detector = request.getfixturevalue(name)
    detector.net.double()
    points, boxes = scene[0].double().requires_grad_(), scene[1].double()
    labels = scene[2].clamp(max=len(detector.classes) - 1)
    probes = probes_of(detector, scene[0]).double()
    computed = detector.occupancy_loss(points, boxes, labels, probes)
    loss, occupancy, row_of = computed.loss, computed.occupancy, computed.rows
    to_points, to_occupancy = torch.autograd.grad(loss, [points, occupancy])
    voxels = voxels_of(detector, points.detach(), probes)
    for row in row_of[len(points) :].unique()[-3:]:
        raised = occupancy.detach().clone()
        raised[row] = 1e-7  # between the kinks of the ReLUs
        change = loss_of(detector, voxels, boxes, labels, raised) - loss.detach()
        assert float(change) == pytest.approx(float(to_occupancy[row]) * 1e-7, rel=1e-2)
    (plain,) = torch.autograd.grad(detector.loss(points, boxes, labels), points)
    torch.testing.assert_close(to_points, plain, rtol=1e-9, atol=1e-15)


def test_probe_points_in_occupied_voxels_and_out_of_range_change_nothing(tiny, scene):
    probes = torch.cat([scene[0][:50], torch.tensor([[50.0, 0.0, 0.0, 0.0]])])
    plain, probed = tiny.occupancy_loss(*scene), tiny.occupancy_loss(*scene, probes)
    assert torch.equal(probed.occupancy, plain.occupancy)
    assert float(probed.loss.detach()) == float(plain.loss.detach())
    assert probed.rows.tolist() == [*plain.rows.tolist(), *plain.rows[:50].tolist(), -1]


def test_the_voxel_grid_equals_the_networks_voxels(tiny, scene):
    grid = tiny.voxel_grid
    keys = grid.keys(grid.cells(scene[0].numpy()))
    rows = tiny.occupancy_loss(*scene).rows.numpy()
    assert len(np.unique(keys)) == len(np.unique(rows)) == len(np.unique(np.stack([keys, rows]), axis=1).T)
    assert grid.cells(np.array([[-6.4, -6.4, -3.0], [-6.41, 0, 0], [np.nan, 0, 0]], np.float32)).tolist() == [
        [0, 0, 0],
        [-1, -1, -1],
        [-1, -1, -1],
    ]


@pytest.mark.parametrize(
    "points",
    [torch.zeros(0, 4), torch.full((5, 4), 1e6), torch.tensor([[1.0, 2.0, -1.0, 0.3]])],
    ids=["no points", "all out of range", "one point"],
)
def test_nearly_empty_clouds_are_processed(tiny, scene, points):
    leaf = points.clone().requires_grad_()
    loss = tiny.loss(leaf, *scene[1:])
    (gradient,) = torch.autograd.grad(loss, leaf)
    assert torch.isfinite(loss)
    assert torch.isfinite(gradient).all()
    if len(points) != 1:
        assert len(tiny.detect(cloud_of(points))) == 0
        assert not gradient.any()
    computed = tiny.occupancy_loss(points, *scene[1:])
    loss, occupancy, point_to_voxel = computed.loss, computed.occupancy, computed.rows
    assert len(occupancy) == (len(points) == 1)
    assert len(point_to_voxel) == len(points)
    loss.backward()


def test_two_million_points_are_processed(tiny):
    rng = np.random.default_rng(1)
    cloud = np.zeros(2_000_000, POINT_DTYPE)
    for name in ("x", "y", "z"):
        cloud[name] = rng.uniform(-8, 8, len(cloud))
    # The same points again weigh nothing: every voxel holds its mean.
    twice = tiny.detect(np.concatenate([cloud[:40_000], cloud[:40_000]]))
    np.testing.assert_allclose(twice.scores, tiny.detect(cloud[:40_000]).scores, rtol=1e-4)
    found = tiny.detect(cloud)
    assert len(found) <= tiny.preset.max_detections
    assert np.isfinite(found.boxes).all()


def test_loss_without_boxes_is_only_background(tiny, scene):
    loss = tiny.loss(scene[0], torch.zeros(0, 7), torch.zeros(0, dtype=torch.int64))
    assert torch.isfinite(loss)
    assert loss > 0


def test_points_that_are_not_finite_are_ignored_in_detection_and_refused_in_losses(tiny, scene):
    points = scene[0].clone()
    points[3, 1] = float("nan")
    with pytest.raises(AdvpipeError, match="not finite"):
        tiny.loss(points, *scene[1:])
    clean = tiny.detect(cloud_of(torch.cat([points[:3], points[4:]])))
    np.testing.assert_array_equal(tiny.detect(cloud_of(points)).boxes, clean.boxes)


def test_detection_is_reproducible(tiny, scene, monkeypatch):
    monkeypatch.setattr(decode, "SCORE_THRESHOLD", 0.01)  # of random weights
    a, b = (tiny.detect(cloud_of(scene[0])) for _ in range(2))
    assert len(a) > 0
    assert a.boxes.tobytes() == b.boxes.tobytes()


def test_weights_are_frozen(tiny, scene):
    points = scene[0].clone().requires_grad_()
    tiny.loss(points, *scene[1:]).backward()
    assert points.grad is not None
    assert all(not p.requires_grad and p.grad is None for p in tiny.net.parameters())
    assert not tiny.net.training


def test_a_network_in_training_mode_is_frozen_by_second():
    net = SecondNet(SMALL).train()
    assert not Second(net).net.training


def test_the_place_of_a_mean_in_its_voxel_is_an_input(tiny):
    """x: 2 cm before the middle of its 10 cm; y: 3 cm beyond; z: 2.1 m, or 11.67 voxels, above the bottom."""
    points = torch.tensor([[0.03, -0.02, -1.0, 0.5]])
    inputs = tiny.net.inputs(tiny.net.voxels([points]))
    assert inputs.shape == (1, 7)
    assert inputs[0, 4:].tolist() == pytest.approx([-0.2, 0.3, 2.1 / 0.18 - 11.5], abs=1e-4)
