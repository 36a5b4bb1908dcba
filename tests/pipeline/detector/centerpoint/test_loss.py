"""The losses of the centre head, against sums worked out one cell at a time."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log

import pytest
import torch

from advpipe.pipeline.detector.centerpoint.head import CentrePredictions
from advpipe.pipeline.detector.centerpoint.loss import centre_losses, focal_heat_loss
from advpipe.pipeline.detector.centerpoint.presets import SMALL
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid, CentreTargets
from advpipe.pipeline.detector.protocol import Range

PRESET = replace(SMALL, range_m=Range(-8.0, -6.4, -3.1, 8.0, 6.4, 2.3), box_heat=1.0, axis_code=False)
GRID = CentreGrid(PRESET, 16, 20)
BOX = torch.tensor([[1.0, -2.0, -0.9, 4.0, 2.0, 1.5, 0.5]])


def sigmoid(x: float) -> float:
    return 1 / (1 + exp(-x))


def test_heat_loss_equals_a_sum_of_its_terms():
    logits = torch.tensor([[0.3], [-1.0], [2.0], [0.7]])
    heat = torch.tensor([[1.0], [0.4], [0.0], [0.0]])
    counted = torch.tensor([[True], [True], [True], [False]])
    none = torch.zeros(0, dtype=torch.int64)
    target = CentreTargets(heat, counted, none, torch.zeros(0, 7), none, torch.zeros(0))
    missed = -((1 - sigmoid(0.3)) ** 2) * log(sigmoid(0.3))
    near = -(sigmoid(-1.0) ** 2) * log(1 - sigmoid(-1.0)) * 0.6**4
    false = -(sigmoid(2.0) ** 2) * log(1 - sigmoid(2.0))
    assert float(focal_heat_loss(logits, target)) == pytest.approx(missed + near + false, rel=1e-5)
    empty = replace(target, heat=torch.zeros(4, 1))
    assert torch.isfinite(focal_heat_loss(logits, empty))


def test_box_loss_is_twice_the_mean_absolute_error_of_the_code():
    target = GRID.assign(torch.cat([BOX, BOX + torch.tensor([3.2, 0, 0, 0, 0, 0, 0])]), torch.tensor([0, 0]))
    codes = torch.zeros(1, 320, 8)
    codes[0, target.cells] = GRID.encode(target.boxes, target.cells)
    codes[0, target.cells[0], :3] += torch.tensor([0.1, -0.2, 0.4])
    predictions = CentrePredictions(torch.zeros(1, 320, 4), codes, torch.zeros(1, 320))
    plain = CentreGrid(replace(GRID.preset, overlap_weight=0.0), GRID.height, GRID.width)
    _, box, quality = centre_losses(predictions, 0, target, plain)
    assert float(box) == pytest.approx(2 * 0.7 / 2, rel=1e-5)
    # A logit of zero costs log 2 whatever the IoU is; weighted .5.
    assert float(quality) == pytest.approx(0.5 * log(2), rel=1e-5)


def test_cells_count_by_their_heat():
    preset = replace(PRESET, box_heat=0.2, overlap_weight=0.0, quality_power=None)
    grid = CentreGrid(preset, GRID.height, GRID.width)
    target = grid.assign(BOX, torch.tensor([0]))
    codes = torch.zeros(1, 320, 8)
    codes[0, target.cells] = grid.encode(target.boxes, target.cells)
    corner, centre = int(target.weights.argmin()), int(target.weights.argmax())
    errors = []
    for place in (corner, centre):
        wrong = codes.clone()
        wrong[0, target.cells[place], 2] += 0.5
        errors.append(
            float(centre_losses(CentrePredictions(torch.zeros(1, 320, 4), wrong), 0, target, grid)[1])
        )
    side, edge = exp(-1 / (2 * (5 / 6) ** 2)), exp(-2 / (2 * (5 / 6) ** 2))
    whole = 1 + 4 * side + 4 * edge
    assert errors == pytest.approx([2 * 0.5 * edge / whole, 2 * 0.5 / whole], rel=1e-4)


def test_without_objects_only_the_heat_counts():
    target = GRID.assign(torch.zeros(0, 7), torch.zeros(0, dtype=torch.int64))
    predictions = CentrePredictions(torch.randn(1, 320, 4), torch.randn(1, 320, 8))
    heat, box, quality = centre_losses(predictions, 0, target, GRID)
    assert heat > 0
    assert box == quality == 0
