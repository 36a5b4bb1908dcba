"""From heat and codes to boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from advpipe.pipeline.detector.centerpoint.decode import decode_centres
from advpipe.pipeline.detector.centerpoint.head import CentrePredictions
from advpipe.pipeline.detector.centerpoint.presets import SMALL
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid
from advpipe.pipeline.detector.protocol import Range

PRESET = replace(
    SMALL,
    range_m=Range(-8.0, -6.4, -3.1, 8.0, 6.4, 2.3),
    quality_power=None,
    axis_code=False,
    vote_iou=None,
)
CAR = [1.0, -2.0, -0.9, 4.0, 2.0, 1.5, 0.5]


def decoded(peaks, **changes):
    """The detections of peaks, each a box, its class and the logit of its score."""
    grid = CentreGrid(replace(PRESET, **changes), 16, 20)
    scores, codes = torch.full((1, 320, 4), -9.0), torch.zeros(1, 320, 8)
    for box, label, logit in peaks:
        box = torch.tensor([box])
        column, row = grid.places(box)[0].long().tolist()
        cell = torch.tensor([row * 20 + column])
        scores[0, cell, label] = logit
        codes[0, cell] = grid.encode(box, cell)
    return decode_centres(CentrePredictions(scores, codes), 0, grid)


def test_peaks_become_boxes_best_first():
    other = [-5.0, 3.0, -0.9, 0.8, 0.7, 1.7, -2.5]
    found = decoded([(CAR, 0, 0.5), (other, 3, 2.0), ([6.0, 5.0, *CAR[2:]], 0, -2.3)])
    np.testing.assert_allclose(found.boxes, [other, CAR], atol=1e-5)  # the third scores less than .1
    assert found.labels.tolist() == [3, 0]
    assert found.scores.tolist() == pytest.approx([1 / (1 + np.exp(-2.0)), 1 / (1 + np.exp(-0.5))], rel=1e-5)


def test_overlapping_boxes_of_a_class_are_suppressed():
    near = [1.0 + 1.6, *CAR[1:]]  # two cells beside it
    assert len(decoded([(CAR, 0, 1.0), (near, 0, 0.5)])) == 1
    assert len(decoded([(CAR, 0, 1.0), (near, 1, 0.5)])) == 2
    assert len(decoded([(CAR, 0, 1.0), (near, 1, 0.5)], suppress_by_class=False)) == 1
    assert len(decoded([(CAR, 0, 1.0), (near, 0, 0.5)], nms_iou=0.7)) == 2


def test_cells_about_a_centre_vote_for_its_box():
    grid = CentreGrid(replace(PRESET, vote_iou=0.5), 16, 20)
    scores, codes = torch.full((1, 320, 4), -9.0), torch.zeros(1, 320, 8)
    for cell, shift, logit in ((111, 0.0, 1.0), (112, 0.2, -0.5)):
        box = torch.tensor([[CAR[0] + shift, *CAR[1:]]])
        scores[0, cell, 0], codes[0, cell] = logit, grid.encode(box, torch.tensor([cell]))[0]
    found = decode_centres(CentrePredictions(scores, codes), 0, grid)
    weights = np.square([1 / (1 + np.exp(-1.0)), 1 / (1 + np.exp(0.5))])
    assert len(found) == 1
    assert found.boxes[0, 0] == pytest.approx(CAR[0] + 0.2 * weights[1] / weights.sum(), abs=1e-5)


def test_a_centre_out_of_range_is_no_detection():
    assert len(decoded([([1.0, -2.0, 2.5, *CAR[3:]], 0, 1.0)])) == 0


def test_the_quality_of_a_box_lowers_its_score():
    grid = CentreGrid(replace(PRESET, quality_power=2.0), 16, 20)
    box = torch.tensor([CAR])
    scores, codes, qualities = torch.full((1, 320, 4), -9.0), torch.zeros(1, 320, 8), torch.zeros(1, 320)
    scores[0, 111, 0], codes[0, 111] = 3.0, grid.encode(box, torch.tensor([111]))[0]
    found = decode_centres(CentrePredictions(scores, codes, qualities), 0, grid)
    assert found.scores.tolist() == pytest.approx([(0.25 / (1 + np.exp(-3.0))) ** (2 / 3)], rel=1e-5)
