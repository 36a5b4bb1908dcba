"""Rotated IoU against shapely, and against numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.iou import intersection_area, iou_3d, iou_bev


def box(x=0.0, y=0.0, z=0.0, length=4.0, width=2.0, height=2.0, yaw=0.0):
    return np.array([[x, y, z, length, width, height, yaw]])


@pytest.mark.parametrize(
    ("other", "bev", "volume"),
    [
        (box(), 1.0, 1.0),
        (box(yaw=np.pi), 1.0, 1.0),
        (box(x=2.0), 4 / 12, 8 / 24),
        (box(yaw=np.pi / 2), 4 / 12, 8 / 24),
        (box(z=1.0), 1.0, 8 / 24),
        (box(z=2.0), 1.0, 0.0),
        (box(x=4.0), 0.0, 0.0),
        (box(x=100.0), 0.0, 0.0),
        (box(length=2.0, width=1.0, height=1.0), 2 / 8, 2 / 16),
        # A square of diagonal 2 inside: area 2.
        (box(length=2**0.5, width=2**0.5, yaw=np.pi / 4), 2 / 8, 4 / 16),
    ],
)
def test_overlaps_equal_values_computed_by_hand(other, bev, volume):
    assert iou_bev(box(), other)[0, 0] == pytest.approx(bev, abs=1e-9)
    assert iou_3d(box(), other)[0, 0] == pytest.approx(volume, abs=1e-9)


@pytest.mark.oracle
def test_area_agrees_with_shapely():
    shapely = pytest.importorskip("shapely", reason="shapely is the oracle")
    rng = np.random.default_rng(3)
    n = 3000
    a, b = (
        np.column_stack([rng.uniform(-3, 3, (n, 3)), rng.uniform(0.3, 8, (n, 3)), rng.uniform(-4, 4, n)])
        for _ in range(2)
    )
    # The hard cases: the same box, a box turned by a hair, shared edges, large coordinates.
    b[:300] = a[:300]
    b[300:600] = a[300:600] + rng.normal(0, 1e-9, (300, 7))
    b[600:900, 6] = a[600:900, 6] + rng.integers(0, 4, 300) * np.pi / 2
    a[900:1200, :2] += 5000
    b[900:1200, :2] += 5000
    polygons = [shapely.polygons(box_corners(boxes)[:, :4, :2]) for boxes in (a, b)]
    expected = shapely.area(shapely.intersection(*polygons))
    np.testing.assert_allclose(intersection_area(a, b), expected, rtol=1e-6, atol=1e-6)


def test_no_boxes_give_an_empty_matrix():
    assert iou_3d(np.zeros((0, 7)), box()).shape == (0, 1)
    assert iou_bev(box(), np.zeros((0, 7))).shape == (1, 0)
    assert iou_bev([], []).shape == (0, 0)


def test_a_box_without_volume_overlaps_nothing():
    assert iou_3d(box(length=0.0), box())[0, 0] == 0
    assert iou_3d(box(length=0.0), box(length=0.0))[0, 0] == 0
