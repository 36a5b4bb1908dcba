"""The losses, against sums worked out one anchor at a time."""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, log, pi, sin

import pytest
import torch

from advpipe.pipeline.detector.common.anchors import AnchorGrid, Targets, encode_boxes
from advpipe.pipeline.detector.common.head import Predictions
from advpipe.pipeline.detector.common.loss import (
    aligned_iou,
    cloud_losses,
    direction_bin,
    focal_losses,
    losses,
)
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.geometry.iou import iou_3d


def test_focal_loss_equals_a_sum_of_its_terms():
    logits = [[-2.0, 0.5], [1.0, -1.0], [0.3, 0.2]]
    target = Targets(torch.tensor([1]), torch.zeros(1, 7), torch.tensor([0]), torch.tensor([2]))

    def sigmoid(x):
        return 1 / (1 + exp(-x))

    def background(x):
        return -0.75 * sigmoid(x) ** 2 * log(1 - sigmoid(x))

    def hit(x):
        return -0.25 * (1 - sigmoid(x)) ** 2 * log(sigmoid(x))

    # Anchor 0 is background, anchor 1 a car (and no truck), anchor 2 ignored.
    expected = background(-2.0) + background(0.5) + hit(1.0) + background(-1.0)
    background_sum, hits = focal_losses(torch.tensor([logits]), [target], torch.tensor([0]))
    assert float(background_sum + hits.sum()) == pytest.approx(expected, rel=1e-6)


def test_a_perfect_prediction_has_almost_no_loss_and_a_half_turn_only_direction_loss():
    grid = AnchorGrid(SMALL, 128, 128)
    box = torch.tensor([[10.3, -7.2, -1.0, 4.2, 1.8, 1.5, 0.3]])
    target = grid.assign(box, torch.tensor([0]))
    count = 128 * 128 * grid.per_cell
    scores, codes, directions = (
        torch.full((1, count, 4), -20.0),
        torch.zeros(1, count, 7),
        torch.zeros(1, count, 2),
    )
    scores[0, target.positive, 0] = 20.0
    codes[0, target.positive] = encode_boxes(target.boxes, grid.boxes(target.positive))
    directions[0, target.positive, direction_bin(box[:, 6], pi / 4)] = 20.0
    perfect = losses(Predictions(scores, codes, directions), [target], grid)
    assert float(perfect.total) < 1e-5

    codes[0, target.positive, 6] += pi
    directions = -directions
    turned = losses(Predictions(scores, codes, directions), [target], grid)
    assert float(turned.box) < 1e-5
    # Cross entropy of the wrong bin by 20, weighted 0.2.
    assert float(turned.direction) == pytest.approx(0.2 * 20, rel=1e-4)


def test_smooth_l1_equals_values_computed_by_hand():
    grid = AnchorGrid(replace(SMALL, overlap_weight=0.0), 128, 128)
    box = torch.tensor([[0.4, 0.4, -1.0, 4.2, 1.8, 1.55, 0.0]])
    target = grid.assign(box, torch.tensor([0]))
    count = 128 * 128 * grid.per_cell
    codes = torch.zeros(1, count, 7)
    codes[0, target.positive] = encode_boxes(target.boxes, grid.boxes(target.positive))
    codes[0, target.positive, 2] += 1.0  # beyond 1/9: |d| - 1/18
    codes[0, target.positive, 3] += 0.1  # within: d^2 / (2/9)
    parts = losses(Predictions(torch.zeros(1, count, 4), codes, torch.zeros(1, count, 2)), [target], grid)
    assert float(parts.box) == pytest.approx(2 * ((1 - 1 / 18) + 0.01 * 4.5), rel=1e-5)


def test_the_quality_target_is_the_iou_of_the_predicted_box():
    """A box that is 1 m off along its 4 m: IoU 3 / 5; cross entropy of 0.5 with that is log 2."""
    grid = AnchorGrid(SMALL, 128, 128)
    box = torch.tensor([[0.4, 0.4, -1.0, 4.0, 1.8, 1.5, 0.7]])
    target = grid.assign(box, torch.tensor([0]))
    along = torch.tensor([cos(0.7), sin(0.7), 0, 0, 0, 0, 0])
    assert float(aligned_iou(box + along, box)) == pytest.approx(3 / 5, rel=1e-5)
    count = 128 * 128 * grid.per_cell
    codes = torch.zeros(1, count, 7)
    codes[0, target.positive] = encode_boxes(target.boxes + along, grid.boxes(target.positive))
    predicted = torch.zeros(1, count, requires_grad=True)
    nothing = Predictions(torch.zeros(1, count, 4), codes, torch.zeros(1, count, 2))
    assert float(losses(nothing, [target], grid).quality) == 0
    parts = losses(replace(nothing, qualities=predicted), [target], grid)
    assert parts.quality.item() == pytest.approx(0.5 * log(2), rel=1e-5)
    parts.quality.backward()
    # The gradient of the cross entropy is what is said less what is true, at every positive anchor.
    slope = 0.5 * (0.5 - 0.6) / len(target.positive)
    assert predicted.grad[0, target.positive].tolist() == pytest.approx(
        [slope] * len(target.positive), rel=1e-4
    )


@pytest.mark.parametrize(
    ("xyz", "size", "iou"),
    [
        ((0, 0, 0), (4, 2, 1), 1),
        ((0, 0, 0.5), (4, 2, 1), 1 / 3),
        ((2, 1, 0.5), (4, 2, 1), 1 / 15),
        ((4, 0, 0), (4, 2, 1), 0),
        ((0, 0, 0), (2, 2, 1), 1 / 2),
    ],
)
def test_aligned_iou_agrees_with_the_rotated_one(xyz, size, iou):
    truth = torch.tensor([[3.0, -2, 1, 4, 2, 1, 0.0]])
    box = torch.tensor([[3.0 + xyz[0], -2 + xyz[1], 1 + xyz[2], *size, 0.0]])
    assert float(aligned_iou(box, truth)) == pytest.approx(iou, abs=1e-6)
    assert float(aligned_iou(box, truth)) == pytest.approx(float(iou_3d(box, truth)[0, 0]), abs=1e-6)


@pytest.mark.parametrize(
    ("yaw", "expected"),
    [(pi / 4 + 0.01, 0), (pi, 0), (5 * pi / 4 - 0.01, 0), (0.0, 1), (pi / 4 - 0.01, 1), (-pi / 2, 1)],
)
def test_direction_bins_are_halves_of_the_circle(yaw, expected):
    assert direction_bin(torch.tensor([yaw]), pi / 4).tolist() == [expected]


def test_the_overlap_of_boxes_adds_to_their_loss():
    """A box that is 1 m off along its 4 m overlaps by 3 / 5; moved back, the loss has no such part."""
    grids = [AnchorGrid(replace(SMALL, overlap_weight=weight), 128, 128) for weight in (0.0, 0.5)]
    box = torch.tensor([[0.4, 0.4, -1.0, 4.0, 1.8, 1.5, 0.0]])
    target = grids[0].assign(box, torch.tensor([0]))
    anchors = grids[0].boxes(target.positive)
    count = 128 * 128 * grids[0].per_cell
    found = []
    for moved_m in (0.0, 1.0):
        codes = torch.zeros(1, count, 7)
        moved = target.boxes + torch.tensor([moved_m, 0, 0, 0, 0, 0, 0])
        codes[0, target.positive] = encode_boxes(moved, anchors)
        predictions = Predictions(torch.zeros(1, count, 4), codes, torch.zeros(1, count, 2))
        without, with_it = (float(losses(predictions, [target], grid).box) for grid in grids)
        found.append(with_it - without)
    assert found == pytest.approx([0.0, 2 * 0.5 * (1 - 3 / 5)], abs=1e-5)


def test_the_losses_of_a_batch_are_the_mean_of_its_clouds():
    generator = torch.Generator().manual_seed(0)
    grid = AnchorGrid(SMALL, 128, 128)
    boxes = torch.tensor([[0.4, 0.4, -1.0, 4.0, 1.8, 1.5, 0.0], [9.0, 3.0, -1.0, 4.4, 1.9, 1.6, 1.0]])
    targets = [grid.assign(boxes[:n], torch.zeros(n, dtype=torch.int64)) for n in (0, 1, 2)]
    count = 128 * 128 * grid.per_cell

    def drawn(columns: int) -> torch.Tensor:
        return torch.randn(3, count, columns, generator=generator)

    predictions = Predictions(drawn(4), drawn(7), drawn(2), drawn(1).squeeze(2))
    alone = [
        torch.stack(cloud_losses(predictions, b, target, grid).parts) for b, target in enumerate(targets)
    ]
    together = torch.stack(losses(predictions, targets, grid).parts)
    torch.testing.assert_close(together, torch.stack(alone).mean(0))
    assert alone[0][1:].tolist() == [0, 0, 0]
