"""Points in boxes, against values computed by hand and a plain check of every pair."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from advpipe.pipeline.geometry.boxes import box_corners, count_points, points_in_boxes


def test_points_on_faces_are_inside_and_points_beyond_are_outside() -> None:
    box = [[10.0, -5.0, 1.0, 4.0, 2.0, 1.5, 0.0]]
    points = [[8, -5, 1], [7.99, -5, 1], [10, -4, 1], [10, -3.99, 1], [10, -5, 1.75], [10, -5, 0.24]]
    assert points_in_boxes(points, box)[0].tolist() == [0, 2, 4]
    assert count_points(points, box).tolist() == [3]
    assert points_in_boxes(points, box, margin_m=0.1)[0].tolist() == [0, 1, 2, 3, 4, 5]


def test_points_are_found_in_a_rotated_box() -> None:
    """Turned by 90 degrees, a box is long along y."""
    points = np.array([[0, 1.9, 0], [1.9, 0, 0]])
    assert points_in_boxes(points, [[0, 0, 0, 4, 2, 2, np.pi / 2]])[0].tolist() == [0]


@pytest.mark.parametrize("spread_m", [3.0, 60.0, 5000.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_pair_agrees_with_shapely(spread_m: float, dtype: type) -> None:
    rng = np.random.default_rng(1)
    count = 25
    sizes = rng.uniform(0.4, 12.0, (count, 3))
    places = rng.normal(0, spread_m, (count, 3)) * (1, 1, 0.01)
    boxes = np.column_stack([places, sizes, rng.uniform(-4, 4, count)])
    near = boxes[rng.integers(count, size=3000), :3] + rng.normal(0, 3, (3000, 3))
    points = near.astype(dtype)
    for box, corners, inside in zip(boxes, box_corners(boxes), points_in_boxes(points, boxes), strict=True):
        floor = shapely.Polygon(corners[:4, :2])
        expected = shapely.contains_xy(floor, points[:, 0], points[:, 1])
        expected &= np.abs(points[:, 2] - box[2]) <= box[5] / 2
        assert inside.tolist() == np.flatnonzero(expected).tolist()


def test_points_and_boxes_that_are_not_finite_match_nothing() -> None:
    points = np.array([[np.nan, 0, 0], [np.inf, 0, 0], [-np.inf, 0, 0], [1e38, 0, 0], [0, 0, 0]], np.float32)
    assert count_points(points, [[0, 0, 0, 2, 2, 2, 0], [np.nan, 0, 0, 2, 2, 2, 0]]).tolist() == [1, 0]
    assert count_points(points, np.zeros((0, 7))).tolist() == []
    assert count_points(np.zeros((0, 3)), [[0, 0, 0, 2, 2, 2, 0]]).tolist() == [0]
