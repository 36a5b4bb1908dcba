"""Regions by hand: a camera that looks along x, with a focal length of 100 px and an image of 200 x 100."""

import numpy as np
import pytest

from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage, image_region
from advpipe.pipeline.geometry.transforms import se3_from_yaw

IMAGE_P_LIDAR = np.array([[100.0, -100.0, 0.0, 0.0], [50.0, 0.0, -100.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
"""u = 100 - 100 y / x, v = 50 - 100 z / x, depth = x."""


def view() -> ConvexRegion:
    return image_region("view", IMAGE_P_LIDAR, 0, 0, 200, 100)


@pytest.mark.parametrize(
    ("point_m", "inside"),
    [
        ((10, 0, 0), True),  # in the middle of the image
        ((10, 9.9, 0), True),  # u = 1
        ((10, 10.1, 0), False),  # u = -1
        ((10, 0, 4.9), True),  # v = 1
        ((10, 0, -5.1), False),  # v = 101
        ((-10, 0, 0), False),  # behind the camera, where u and v are in the image, too
    ],
)
def test_a_view_holds_what_its_image_shows(point_m, inside):
    assert view().contains(np.array([point_m])).tolist() == [inside]


def test_a_view_turns_with_its_frame():
    turned = view().transformed(se3_from_yaw((1.0, 2.0, 3.0), np.pi / 2))
    assert turned.contains(np.array([[1, 12, 3], [11, 2, 3]])).tolist() == [True, False]


def test_a_region_without_planes_ends_at_its_range():
    near = ConvexRegion("near", max_range_m=5.0)
    assert near.contains(np.array([[3, 4, 100], [3.1, 4, 0]])).tolist() == [True, False]


def test_what_counts_lies_in_a_labelled_region_and_in_no_ignored_one():
    points = np.array([[10.0, 0, 0], [10, 9, 0], [-10, 0, 0]])
    ignored = image_region("DontCare", IMAGE_P_LIDAR, 0, 0, 20, 100)  # y from 8 to 10 at 10 m
    assert LabelCoverage().counts(points).tolist() == [True, True, True]
    assert LabelCoverage((view(),)).counts(points).tolist() == [True, True, False]
    assert LabelCoverage((view(),), (ignored,)).counts(points).tolist() == [True, False, False]
    assert LabelCoverage((), (ignored,)).counts(points).tolist() == [True, False, True]
    assert LabelCoverage((view(),)).counts(np.zeros((0, 3))).tolist() == []
