"""The targets of the heat map and of boxes, worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, log, sin, sqrt

import numpy as np
import pytest
import torch

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.detector.centerpoint.presets import SMALL
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid, peak_radius
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.messages.labels import IgnoredBoxes

PRESET = replace(SMALL, range_m=Range(-8.0, -6.4, -3.1, 8.0, 6.4, 2.3), box_heat=1.0, axis_code=False)
CAR = [1.0, -2.0, -0.9, 4.0, 2.0, 1.5, 0.5]


@pytest.fixture
def grid() -> CentreGrid:
    """16 rows of 20 cells of 0.8 m."""
    return CentreGrid(PRESET, 16, 20)


def test_the_radius_of_a_peak_equals_one_computed_by_hand():
    # A box of 5 x 2.5 cells at an overlap of .1: b = 7.5 and c = 12.5 * .9 / 1.1; then twice that, and so on.
    first = (7.5 + sqrt(7.5**2 - 4 * 12.5 * 0.9 / 1.1)) / 2
    second = (15 + sqrt(15**2 - 4 * 4 * 0.9 * 12.5)) / 2
    third = (-0.2 * 7.5 + sqrt((0.2 * 7.5) ** 2 + 4 * 0.4 * 0.9 * 12.5)) / 2
    assert min(first, second, third) == pytest.approx(third) == pytest.approx(1.5, abs=0.3)
    found = peak_radius(torch.tensor([[5.0, 2.5], [50.0, 25.0]]), 0.1)
    assert found.tolist() == pytest.approx([third, 10 * third], rel=1e-5)


def test_the_heat_about_a_car_equals_a_gaussian(grid):
    target = grid.assign(torch.tensor([CAR]), torch.tensor([0]))
    heat = target.heat.view(16, 20, 4)
    # Its centre is 9 m and 4.4 m into the map: in column 11.25 and row 5.5. The radius is the least one, 2.
    assert target.cells.tolist() == [5 * 20 + 11]
    assert target.weights.tolist() == [1]
    assert heat[5, 11, 0] == 1
    deviation = 5 / 6
    for row, column in ((5, 12), (6, 11), (7, 9), (3, 13)):
        squared = (row - 5) ** 2 + (column - 11) ** 2
        assert float(heat[row, column, 0]) == pytest.approx(exp(-squared / (2 * deviation**2)), rel=1e-5)
    assert not heat[5, 14].any()
    assert not heat[2, 11].any()
    assert int((heat > 0).sum()) == 25
    assert not heat[:, :, 1:].any()
    assert target.counted.all()


def test_large_objects_have_wide_peaks_and_the_higher_one_counts(grid):
    truck = [-3.0, 0.4, 0.0, 16.0, 8.0, 4.0, 0.0]  # 20 x 10 cells
    near = [-3.0 + 2.4, 0.4, 0.0, 4.0, 2.0, 1.5, 0.0]  # three cells beside it
    radius = int(float(peak_radius(torch.tensor([[20.0, 10.0]]), 0.1)))
    assert radius > 2
    heat = grid.assign(torch.tensor([truck, near]), torch.tensor([1, 1])).heat.view(16, 20, 4)
    spread = (2 * radius + 1) / 6
    assert heat[8, 6, 1] == heat[8, 9, 1] == 1
    assert float(heat[8, 7, 1]) == pytest.approx(exp(-1 / (2 * spread**2)), rel=1e-5)
    assert float(heat[9, 8, 1]) == pytest.approx(
        max(exp(-5 / (2 * spread**2)), exp(-2 / (2 * (5 / 6) ** 2))), rel=1e-5
    )


def test_the_code_of_a_box_equals_one_computed_by_hand(grid):
    box, cells = torch.tensor([CAR]), torch.tensor([5 * 20 + 11])
    expected = [0.25, 0.5, -0.9, log(4.0), log(2.0), log(1.5), cos(0.5), sin(0.5)]
    assert grid.encode(box, cells)[0].tolist() == pytest.approx(expected, abs=1e-5)
    torch.testing.assert_close(grid.decode(grid.encode(box, cells), cells), box)
    beside = torch.tensor([6 * 20 + 10])
    assert grid.encode(box, beside)[0, :2].tolist() == pytest.approx([1.25, -0.5], abs=1e-5)
    torch.testing.assert_close(grid.decode(grid.encode(box, beside), beside), box)


@pytest.mark.parametrize("yaw", [0.5, -0.5, 1.6, 3.0, -3.0, -1.8])
def test_with_an_axis_code_the_heading_only_decides_the_front(yaw):
    grid = CentreGrid(replace(PRESET, axis_code=True), 16, 20)
    box, cells = torch.tensor([[*CAR[:6], yaw]]), torch.tensor([5 * 20 + 11])
    code = grid.encode(box, cells)
    assert code[0, 6:].tolist() == pytest.approx([cos(yaw), sin(yaw), cos(2 * yaw), sin(2 * yaw)], abs=1e-5)
    code[0, 6:8] *= 0.01  # in doubt
    code[0, 6] += 0.001
    found = grid.decode(code, cells)
    turned = float(found[0, 6]) - yaw
    assert (cos(turned), sin(turned)) == pytest.approx((1, 0), abs=1e-5)
    torch.testing.assert_close(found[:, :6], box[:, :6])
    code[0, 6:8] *= -1
    assert cos(float(grid.decode(code, cells)[0, 6]) - yaw) == pytest.approx(-1, abs=1e-5)


def test_cells_about_a_centre_learn_the_box_of_the_higher_peak():
    grid = CentreGrid(replace(PRESET, box_heat=0.2), 16, 20)
    near = [CAR[0] + 2.4, *CAR[1:]]  # three columns beside it
    target = grid.assign(torch.tensor([CAR, near]), torch.tensor([0, 1]))
    own = {(5 + row, 11 + column) for row in (-1, 0, 1) for column in (-1, 0, 1)}
    first = target.labels == 0
    assert {divmod(cell, 20) for cell in target.cells[first].tolist()} == own
    assert {divmod(cell, 20) for cell in target.cells[~first].tolist()} == {(r, c + 3) for r, c in own}
    assert (target.boxes[first] == torch.tensor(CAR)).all()
    side, corner = exp(-1 / (2 * (5 / 6) ** 2)), exp(-2 / (2 * (5 / 6) ** 2))
    assert sorted(target.weights[first].tolist()) == pytest.approx([corner] * 4 + [side] * 4 + [1], rel=1e-5)

    closer = [CAR[0] + 0.8, *CAR[1:]]  # the next column: each keeps its own half
    target = grid.assign(torch.tensor([CAR, closer]), torch.tensor([0, 0]))
    columns = [sorted({cell % 20 for cell in target.cells[boxes].tolist()}) for boxes in _of(target, CAR)]
    assert columns == [[10, 11], [12, 13]]


def _of(target, box):
    """Which cells learn this box, and which do not."""
    mine = (target.boxes == torch.tensor(box)).all(1)
    return mine, ~mine


def test_boxes_out_of_range_are_no_targets(grid):
    target = grid.assign(torch.tensor([[9.0, *CAR[1:]]]), torch.tensor([0]))
    assert len(target.cells) == 0
    assert not target.heat.any()
    assert target.counted.all()


def test_about_an_ignored_box_its_class_does_not_count(grid):
    boxes = torch.tensor([CAR, [1.0, -0.4, *CAR[2:]]])  # two rows apart
    target = grid.assign(boxes, torch.tensor([0, 0]), torch.tensor([False, True]))
    counted = target.counted.view(16, 20, 4)
    assert len(target.cells) == 1
    assert counted[:, :, 1:].all()
    assert counted[5, 11, 0]  # the peak of the first lies within the second's square
    assert int((~counted[:, :, 0]).sum()) == 24
    assert not counted[7, 11, 0]


def test_about_objects_that_do_not_count_no_class_does(grid):
    objects = IgnoredBoxes(np.array([CAR]))
    target = grid.assign(torch.zeros(0, 7), torch.zeros(0, dtype=torch.int64), None, Uncounted(objects))
    counted = target.counted.view(16, 20, 4)
    assert not counted[3:8, 9:14].any()
    assert int((~counted).sum()) == 4 * 25
