"""Overlap and suppression, by numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.geometry.iou import iou_2d
from advpipe.pipeline.image_detector.boxes import best_of_each, pairwise_iou

A = [0.0, 0.0, 10.0, 10.0]
B = [5.0, 0.0, 15.0, 10.0]  # shares 50 of 150
C = [20.0, 20.0, 30.0, 30.0]
POINT = [5.0, 5.0, 5.0, 5.0]


def test_overlaps_are_those_worked_by_hand() -> None:
    wanted = np.array([[1.0, 1 / 3, 0.0, 0.0], [1 / 3, 1.0, 0.0, 0.0]])
    boxes, others = np.array([A, B]), np.array([A, B, C, POINT])
    np.testing.assert_allclose(iou_2d(boxes, others), wanted)
    np.testing.assert_allclose(
        pairwise_iou(torch.tensor([A, B]), torch.tensor([A, B, C, POINT])), wanted, 1e-6
    )
    assert iou_2d(np.zeros((0, 4)), others).shape == (0, 4)


@pytest.mark.parametrize(
    ("labels", "kept"), [([0, 0, 0, 0], [0, 3]), ([0, 1, 0, 0], [0, 1, 3]), ([0, 1, 1, 0], [0, 1, 3])]
)
def test_a_box_that_repeats_a_better_one_of_its_class_is_left_out(labels: list[int], kept: list[int]) -> None:
    near, nearer = [1.0, 0.0, 11.0, 10.0], [0.5, 0.0, 10.5, 10.0]
    boxes = torch.tensor([A, near, nearer, C])
    assert best_of_each(boxes, torch.tensor(labels)).tolist() == kept


def test_half_an_overlap_is_another_object() -> None:
    assert best_of_each(torch.tensor([A, B]), torch.tensor([0, 0])).tolist() == [0, 1]
