"""The rectangle of a box in an image, against points laid densely on its surface."""

import numpy as np
import pytest

from advpipe.pipeline.kitti.projection import NEAREST_M, project_box

P_LIDAR = np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]) @ np.array(
    [[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
)
"""A camera at the LiDAR, looking forward."""
WIDTH, HEIGHT = 1200, 360


def surface_pixels(box):
    """Pixels of points all over the box that lie before the camera."""
    x, y, z, length, width, height, yaw = box
    steps = np.linspace(-0.5, 0.5, 81)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    grid = grid[(np.abs(grid) == 0.5).any(axis=1)] * [length, width, height]
    c, s = np.cos(yaw), np.sin(yaw)
    points = np.column_stack([grid[:, 0] * c - grid[:, 1] * s, grid[:, 0] * s + grid[:, 1] * c, grid[:, 2]])
    image = np.column_stack([points + [x, y, z], np.ones(len(points))]) @ P_LIDAR.T
    image = image[image[:, 2] >= NEAREST_M]
    return image[:, :2] / image[:, 2:]


@pytest.mark.parametrize(
    "box", [(20, 3, -1, 4, 1.8, 1.6, 0.7), (8, -6, -1, 4, 1.8, 1.6, -2.0), (30, 0, 0, 1, 1, 2, 0)]
)
def test_the_rectangle_encloses_the_surface(box):
    pixels = surface_pixels(box)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    rectangle = project_box(P_LIDAR, np.array(box, float), WIDTH, HEIGHT)
    expected = [*np.clip(low, 0, [WIDTH - 1, HEIGHT - 1]), *np.clip(high, 0, [WIDTH - 1, HEIGHT - 1])]
    assert rectangle.edges_px == pytest.approx(expected, abs=1e-6)
    shown = (expected[2] - expected[0]) * (expected[3] - expected[1])
    assert rectangle.truncation == pytest.approx(1 - shown / np.prod(high - low), abs=1e-9)


def test_a_box_beside_the_camera_is_cut_and_reaches_the_edge():
    rectangle = project_box(P_LIDAR, np.array([1.0, 2.0, -1.0, 6.0, 1.8, 1.6, 0.0]), WIDTH, HEIGHT)
    left, _, right, bottom = rectangle.edges_px
    assert (left, bottom) == (0.0, HEIGHT - 1.0)
    # Its far edge, 4 m ahead and 1.1 m to the left, is farthest to the right in the image.
    assert right == pytest.approx(600 - 700 * 1.1 / 4)
    assert 0.5 < rectangle.truncation < 1


@pytest.mark.parametrize("box", [(-10, 0, 0, 4, 2, 2, 0), (5, 30, 0, 4, 2, 2, 0), (10, 0, 30, 4, 2, 2, 0)])
def test_a_box_that_no_pixel_shows_has_no_rectangle(box):
    assert project_box(P_LIDAR, np.array(box, float), WIDTH, HEIGHT) is None
