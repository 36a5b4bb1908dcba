"""Rectangles around points, against comparing all with all."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.rectangle_map import RectangleMap

RNG = np.random.default_rng(0)
LOW_M = RNG.uniform(-50, 50, (40, 2))
HIGH_M = LOW_M + RNG.uniform(0.1, 9, (40, 2))
POINTS_M = RNG.uniform(-70, 70, (2, 5000)).astype(np.float32)


def around(points_m: np.ndarray) -> set[tuple[int, int]]:
    """All pairs of a point and a rectangle around it."""
    inside = np.ones((points_m.shape[1], len(LOW_M)), bool)
    for axis in range(2):
        inside &= points_m[axis, :, None] >= LOW_M[:, axis]
        inside &= points_m[axis, :, None] <= HIGH_M[:, axis]
    return set(zip(*(index.tolist() for index in np.nonzero(inside)), strict=True))


@pytest.mark.parametrize("cells", [(128, 128), (300, 7), (600, 90)])
def test_every_rectangle_around_a_point_is_found(cells: tuple[int, int]) -> None:
    points, rectangles = RectangleMap(LOW_M, HIGH_M, cells).pairs(*POINTS_M)
    found = set(zip(points.tolist(), rectangles.tolist(), strict=True))
    expected = around(POINTS_M)
    assert len(expected) > 150
    assert expected <= found
    assert len(found) == len(points) < 0.1 * len(LOW_M) * POINTS_M.shape[1]


def test_pairs_are_in_the_order_of_points_and_then_of_rectangles() -> None:
    points, rectangles = RectangleMap(LOW_M, HIGH_M).pairs(*POINTS_M)
    assert (np.diff(points * len(LOW_M) + rectangles) > 0).all()


def test_points_in_the_corners_of_a_rectangle_are_found_and_those_beside_the_grid_are_not() -> None:
    low_m, high_m = np.array([[1000.1, -3.3]]), np.array([[1007.7, 4.9]])
    corners = np.array([[1000.1, 1007.7, 1000.1, 1007.7, 999.0, 1009.0], [-3.3, 4.9, 4.9, -3.3, 0.0, 0.0]])
    points, _ = RectangleMap(low_m, high_m).pairs(*corners.astype(np.float32))
    assert points.tolist() == [0, 1, 2, 3]


def test_no_rectangles_and_empty_ones_contain_nothing() -> None:
    assert len(RectangleMap(LOW_M[:0], HIGH_M[:0])) == 0
    assert len(RectangleMap(HIGH_M, LOW_M).pairs(*POINTS_M)[0]) == 0
    assert len(RectangleMap(LOW_M[:0], HIGH_M[:0]).pairs(*POINTS_M)[0]) == 0
    assert len(RectangleMap(LOW_M, HIGH_M).pairs(*POINTS_M[:, :0])[0]) == 0
