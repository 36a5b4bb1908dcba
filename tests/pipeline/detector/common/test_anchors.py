"""Anchors: positions, box codes, and the assignment of boxes to anchors."""

from __future__ import annotations

from math import pi

import pytest
import torch

from advpipe.pipeline.detector.common.anchors import AnchorGrid, decode_boxes, encode_boxes
from advpipe.pipeline.detector.second.presets import SMALL

GRID = AnchorGrid(SMALL, 128, 128)
CAR = [0.4, 0.4, -1.0, 4.5, 1.85, 1.55, 0.0]  # centred on a cell


def targets(*boxes, labels, ignored=None):
    mask = None if ignored is None else torch.tensor(ignored)
    return GRID.assign(torch.tensor(boxes).reshape(-1, 7), torch.tensor(labels, dtype=torch.int64), mask)


def test_anchors_are_at_the_centres_of_cells():
    assert GRID.per_cell == 12
    boxes = GRID.boxes(torch.tensor([0, 13, 128 * 12 + 2]))
    expected = [
        [-50.8, -50.8, -1.8 + 1.55 / 2, 4.2, 1.8, 1.55, 0.0],
        [-50.0, -50.8, -1.8 + 1.55 / 2, 4.2, 1.8, 1.55, pi / 2],
        [-50.8, -50.0, -1.8 + 2.3 / 2, 5.4, 2.05, 2.3, 0.0],
    ]
    torch.testing.assert_close(boxes, torch.tensor(expected))


def test_a_car_at_a_cells_centre_is_assigned_to_its_anchor():
    found = targets(CAR, labels=[0])
    places = GRID.boxes(found.positive)
    # Shifted by one cell (0.8 m) along: IoU 3.7 / 5.3 = .70, two cells 2.9 / 6.1 = .48;
    # across: 1.05 / 2.65 = .40. Positive from .6, ignored from .45.
    assert sorted(places[:, 0].tolist()) == pytest.approx([-0.4, 0.4, 1.2], abs=1e-4)
    assert places[:, 1].tolist() == pytest.approx([0.4] * 3, abs=1e-4)
    assert (places[:, 6] == 0).all()
    assert found.labels.tolist() == [0, 0, 0]
    grey = GRID.boxes(found.ignored)
    assert sorted(grey[:, 0].tolist()) == pytest.approx([-1.2, 2.0], abs=1e-4)


@pytest.mark.parametrize("yaw", [pi / 2, -pi / 2, 3 * pi / 2])
def test_a_car_across_is_assigned_to_the_rotated_anchor(yaw):
    found = targets([*CAR[:6], yaw], labels=[0])
    assert GRID.boxes(found.positive)[:, 6].tolist() == pytest.approx([pi / 2] * 3)


def test_a_box_that_fits_no_anchor_is_assigned_to_its_best():
    found = targets([0.0, 0.0, -1.0, 1.0, 0.4, 1.0, 0.0], labels=[0])
    assert len(found.positive) >= 1


def test_anchors_of_an_ignored_box_are_neither_positive_nor_background():
    found = targets(CAR, labels=[0], ignored=[True])
    assert len(found.positive) == 0
    assert len(found.ignored) == 5


def test_each_class_has_its_own_anchors():
    found = targets(CAR, [10.0, 10.0, -0.9, 0.8, 0.7, 1.75, 0.3], labels=[0, 3])
    assert set(found.labels.tolist()) == {0, 3}
    assert torch.equal(GRID.labels[found.positive % 12], found.labels)


def test_boxes_out_of_range_give_no_targets():
    for found in (targets([60.0, *CAR[1:]], labels=[0]), targets(labels=[])):
        assert len(found.positive) == len(found.ignored) == 0


def test_decode_inverts_encode():
    torch.manual_seed(0)
    anchors = GRID.boxes(torch.randint(0, 128 * 128 * GRID.per_cell, (50,)))
    boxes = anchors + torch.randn(50, 7) * 0.1
    torch.testing.assert_close(
        decode_boxes(encode_boxes(boxes, anchors), anchors), boxes, atol=1e-4, rtol=1e-4
    )


def test_the_code_equals_one_computed_by_hand():
    anchor = torch.tensor([[0.0, 0.0, 0.0, 4.0, 3.0, 2.0, 0.0]])
    box = torch.tensor([[5.0, 10.0, 1.0, 4.0, 3.0, 2.0 * 2.718281828, 0.5]])
    torch.testing.assert_close(encode_boxes(box, anchor), torch.tensor([[1.0, 2.0, 0.5, 0.0, 0.0, 1.0, 0.5]]))
