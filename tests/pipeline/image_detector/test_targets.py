"""What cells learn, and that a head which has learned it perfectly gives the objects back."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.image_detector.loss import box_loss, losses, score_loss
from advpipe.pipeline.image_detector.network import Cells, cell_boxes_px
from advpipe.pipeline.image_detector.network_detector import Proposals, decode
from advpipe.pipeline.image_detector.targets import PictureObjects, targets_of

BOXES = np.array([[8, 8, 71, 39], [100, 20, 111, 59], [30, 10, 45, 25]], np.float32)
OBJECTS = PictureObjects(BOXES, np.array([0, 3, 0]), np.ones(3, bool))
ROWS, COLUMNS = 16, 32


def perfect(objects: PictureObjects) -> Cells:
    """A head that says exactly what it was to learn."""
    targets = targets_of(objects, 4, ROWS, COLUMNS)
    scores = torch.from_numpy(np.nan_to_num(targets.heat)).clamp(1e-6, 1 - 1e-6)
    return Cells(torch.logit(scores)[None], torch.from_numpy(targets.boxes_px)[None])


def test_the_middle_of_each_object_is_its_highest_cell() -> None:
    heat = targets_of(OBJECTS, 4, ROWS, COLUMNS).heat
    assert [tuple(each) for each in np.argwhere(heat == 1)] == [(0, 4, 9), (0, 6, 10), (3, 10, 26)]


def test_a_perfect_head_gives_the_objects_back() -> None:
    found = decode(Proposals.of(perfect(OBJECTS)), 0.9)
    assert {(*box, label) for box, label in zip(found.boxes_px.tolist(), found.labels, strict=True)} == {
        (*box, label) for box, label in zip(BOXES.tolist(), OBJECTS.labels, strict=True)
    }


def test_a_shared_cell_learns_the_smaller_box() -> None:
    targets = targets_of(OBJECTS, 4, ROWS, COLUMNS)
    assert targets.boxes_px[:, 4, 9].tolist() == BOXES[2].tolist()
    assert targets.weights[4, 9] > 0


def test_weights_of_an_object_are_one_and_the_logarithm_of_its_area_in_cells() -> None:
    alone = PictureObjects(BOXES[1:2], np.array([3]), np.ones(1, bool))
    weights = targets_of(alone, 4, ROWS, COLUMNS).weights
    assert weights.sum() == pytest.approx(1 + np.log(12 * 40 / 16), rel=1e-5)


def test_an_object_that_is_not_learned_teaches_neither() -> None:
    hidden = PictureObjects(BOXES, OBJECTS.labels, np.array([True, False, True]))
    targets = targets_of(hidden, 4, ROWS, COLUMNS)
    assert np.isnan(targets.heat[3]).any()
    assert not targets.weights[:, 24:].any()
    logits = torch.zeros(1, 4, ROWS, COLUMNS, requires_grad=True)
    score_loss(logits, torch.from_numpy(targets.heat)[None]).backward()
    assert logits.grad is not None
    assert logits.grad[0, 3, 10, 26] == 0
    assert logits.grad[0, 3, 0, 0] > 0 > logits.grad[0, 0, 4, 9]


def test_boxes_at_the_edge_of_the_picture_have_targets() -> None:
    edges = np.array([[0, 0, 3, 3], [120, 60, 127, 63], [-40, 0, 20, 40]], np.float32)
    targets = targets_of(PictureObjects(edges, np.zeros(3, np.int64), np.ones(3, bool)), 4, ROWS, COLUMNS)
    assert (targets.heat == 1).sum() == 3


def test_losses_are_those_worked_by_hand() -> None:
    logits = torch.zeros(1, 1, 1, 2)  # scores of one half
    heat = torch.tensor([[[[1.0, 0.5]]]])
    wanted = -(0.25 * np.log(0.5) + 0.5**4 * 0.25 * np.log(0.5))
    assert float(score_loss(logits, heat)) == pytest.approx(wanted)
    boxes, apart = (torch.tensor(each).reshape(1, 4, 1, 1) for each in ([0.0, 0, 2, 2], [4.0, 0, 6, 2]))
    weights = torch.ones(1, 1, 1)
    assert float(box_loss(boxes, boxes, weights)) == pytest.approx(0)
    assert float(box_loss(boxes, apart, weights)) == pytest.approx(1 + (12 - 8) / 12)
    parts = losses(
        Cells(logits, boxes.expand(1, 4, 1, 2)), heat, boxes.expand(1, 4, 1, 2), weights.expand(1, 1, 2)
    )
    assert parts.shape == (2,)
    assert float(parts[1]) == pytest.approx(0)


def test_distances_of_cells_become_boxes_inside_the_picture() -> None:
    edges = torch.full((1, 4, 2, 3), float(np.log(np.e - 1)))  # softplus 1: 16 pixels
    boxes = cell_boxes_px(edges, 8, 100)
    assert boxes[0, :, 1, 2].tolist() == pytest.approx([0, 0, 9.5 + 16, 7])  # 9.5 - 16 and 5.5 +- 16 are cut
