"""From raw predictions to boxes."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
import shapely
import shapely.affinity
import torch

from advpipe.pipeline.detector.common.anchors import AnchorGrid, encode_boxes
from advpipe.pipeline.detector.common.decode import decode_detections, suppress, vote
from advpipe.pipeline.detector.common.head import Predictions
from advpipe.pipeline.detector.common.loss import direction_bin
from advpipe.pipeline.detector.second.presets import SMALL

GRID = AnchorGrid(SMALL, 128, 128)


def predictions(boxes, labels, scores):
    """What a head would say that sees exactly these boxes, at every positive anchor."""
    count = 128 * 128 * GRID.per_cell
    out = Predictions(torch.full((1, count, 4), -9.0), torch.zeros(1, count, 7), torch.zeros(1, count, 2))
    for box, label, score in zip(boxes, labels, scores, strict=True):
        target = GRID.assign(box[None], label[None])
        code = encode_boxes(target.boxes, GRID.boxes(target.positive))
        out.scores[0, target.positive, label] = torch.logit(torch.tensor(score))
        # The head learns the heading only up to half a turn: the direction bin has to mend it.
        code[:, 6] = code[:, 6] + pi
        out.codes[0, target.positive] = code
        out.directions[0, target.positive, direction_bin(box[6:7], pi / 4)] = 3.0
    return out


def test_each_box_is_returned_once_best_first():
    boxes = torch.tensor(
        [
            [10.3, -7.2, -1.0, 4.2, 1.8, 1.5, 0.3],
            [-20.1, 3.0, -0.2, 10.5, 2.6, 3.1, -2.0],
            [5.0, 30.0, -1.0, 1.8, 0.7, 1.7, 3.0],
            [-3.0, -3.0, -0.9, 0.7, 0.6, 1.7, -1.2],
            [30.0, 30.0, -1.0, 4.2, 1.8, 1.5, 0.0],
        ]
    )
    labels = torch.tensor([0, 1, 2, 3, 0])
    found = decode_detections(predictions(boxes, labels, [0.6, 0.9, 0.3, 0.7, 0.05]), 0, GRID)
    assert found.scores == pytest.approx([0.9, 0.7, 0.6, 0.3], rel=1e-5)
    assert found.labels.tolist() == [1, 3, 0, 2]
    expected = boxes[[1, 3, 0, 2]].numpy().astype(np.float64)
    np.testing.assert_allclose(found.boxes, expected, atol=1e-4)


def test_no_detection_scores_below_the_threshold():
    box = torch.tensor([[10.3, -7.2, -1.0, 4.2, 1.8, 1.5, 0.3]])
    assert len(decode_detections(predictions(box, torch.tensor([0]), [0.09]), 0, GRID)) == 0


@pytest.mark.parametrize("by_class", [True, False])
def test_an_object_of_two_likely_classes_is_returned_as_both_or_as_the_likelier(by_class):
    box = torch.tensor([[5.0, 3.0, -1.0, 1.8, 0.7, 1.7, 0.0]])
    out = predictions(box, torch.tensor([2]), [0.4])
    anchors = GRID.assign(box, torch.tensor([2])).positive
    out.scores[0, anchors, 3] = torch.logit(torch.tensor(0.7))
    found = decode_detections(out, 0, AnchorGrid(replace(SMALL, suppress_by_class=by_class), 128, 128))
    assert found.labels.tolist() == ([3, 2] if by_class else [3])
    assert found.scores == pytest.approx([0.7, 0.4] if by_class else [0.7], rel=1e-5)
    np.testing.assert_allclose(found.boxes, np.repeat(box.numpy(), len(found), axis=0), atol=1e-4)


def test_predicted_quality_ranks_the_better_placed_of_two_boxes_first():
    """Class scores 0.9 and 0.8, IoUs 0.5 and 0.9: 0.9 * 0.5 < 0.8 * 0.9; power 2 squares the IoUs, and the
    product is raised to 2 / 3."""
    boxes = torch.tensor([[10.0, 0.0, -1.0, 4.2, 1.8, 1.5, 0.3], [10.4, 0.0, -1.0, 4.2, 1.8, 1.5, 0.3]])
    target = GRID.assign(boxes[:1], torch.tensor([0]))
    anchors = target.positive[:2]
    out = predictions(boxes[:0], torch.zeros(0, dtype=torch.int64), [])
    out.scores[0, anchors, 0] = torch.logit(torch.tensor([0.9, 0.8]))
    out.codes[0, anchors] = encode_boxes(boxes, GRID.boxes(anchors))
    out = replace(out, qualities=torch.full((1, out.scores.shape[1]), -9.0))
    out.qualities[0, anchors] = torch.logit(torch.tensor([0.5, 0.9]))
    for power, score in ((1.0, 0.72), (2.0, 0.648 ** (2 / 3))):
        grid = AnchorGrid(replace(SMALL, quality_power=power, vote_iou=None), 128, 128)
        found = decode_detections(out, 0, grid)
        assert found.scores == pytest.approx([score], rel=1e-5)
        assert found.boxes[0, 0] == pytest.approx(10.4, abs=1e-4)


def test_suppression_is_greedy():
    # b overlaps a and c, a and c stay apart: a and c remain.
    boxes = np.array([[x, 0, 0, 4, 2, 2, 0] for x in (0.0, 2.0, 4.1)])
    one = np.zeros(3, np.int64)
    assert suppress(boxes, one, 0.1, 9).tolist() == [0, 2]
    assert suppress(boxes, one, 0.1, 1).tolist() == [0]
    assert suppress(boxes, np.array([0, 1, 0]), 0.1, 9).tolist() == [0, 1, 2]
    assert suppress(np.zeros((0, 7)), one[:0], 0.1, 9).tolist() == []


def test_votes_are_weighted_by_squared_score_within_the_class():
    """Scores 0.8 and 0.4 weigh 4 : 1; the box of another class and the far one have no say."""
    boxes = np.array(
        [
            [0.0, 0.0, 0.0, 4.0, 2.0, 1.5, 3.1],
            [0.5, 0.0, 0.1, 4.5, 2.0, 1.5, -3.1],  # turned by 0.083 beyond pi, not by -6.2
            [0.2, 0.0, 0.9, 4.0, 2.0, 9.0, 3.1],
            [9.0, 9.0, 0.0, 4.0, 2.0, 1.5, 0.0],
        ]
    )
    scores, labels = np.array([0.8, 0.4, 0.7, 0.6]), np.array([0, 0, 1, 0])
    (first, last) = vote(boxes, scores, labels, np.array([0, 3]), 0.5)
    np.testing.assert_allclose(first[:6], [0.1, 0.0, 0.02, 4.1, 2.0, 1.5])
    assert first[6] == pytest.approx(3.1 + 0.2 * (2 * np.pi - 6.2))
    np.testing.assert_allclose(last, boxes[3])


@pytest.mark.oracle
@pytest.mark.parametrize("limit", [4, 500])
def test_suppression_agrees_with_polygon_overlaps(limit):
    """What is kept overlaps nothing kept before by more than the limit; what is not kept does (shapely)."""
    rng = np.random.default_rng(2)
    low, high = [-15, -15, -1, 2, 1, 1, -3], [15, 15, 1, 5, 2.5, 2, 3]
    boxes = rng.uniform(low, high, (120, 7))
    kept = suppress(boxes, np.zeros(120, np.int64), 0.01, limit).tolist()
    shapes = [polygon(box) for box in boxes]
    expected = []
    for i, shape in enumerate(shapes):
        overlaps = [shape.intersection(shapes[k]).area / shape.union(shapes[k]).area for k in expected]
        if len(expected) < limit and max(overlaps, default=0) <= 0.01:
            expected.append(i)
    assert kept == expected
    assert 4 <= len(kept) < 60


def polygon(box):
    x, y, _, length, width, _, yaw = box
    flat = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return shapely.affinity.translate(shapely.affinity.rotate(flat, yaw, (0, 0), use_radians=True), x, y)
