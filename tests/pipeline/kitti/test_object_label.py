"""KITTI's label lines: read, written, and their boxes in the LiDAR's frame."""

import math

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.kitti.calibration import KittiCalibration
from advpipe.pipeline.kitti.object_label import (
    ObjectLabel,
    camera_box,
    observation_angle,
    read_object_labels,
)

AHEAD = KittiCalibration(
    {2: np.eye(3, 4)},
    np.eye(3),
    np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.1], [1, 0, 0, -0.25], [0, 0, 0, 1]]),
)
"""The camera stands .25 m ahead of the LiDAR and .1 m below it: x right, y down, z forward."""

LINES = """\
Car 0.88 3 -0.69 0.00 192.37 402.31 374.00 1.60 1.57 3.23 -2.70 1.74 3.68 -1.29
Person_sitting 0.00 0 0.14 562.59 158.20 594.85 225.88 1.83 0.69 1.03 -0.77 1.23 19.57 3.12
DontCare -1 -1 -10 800.38 163.67 825.45 184.07 -1 -1 -1 -1000 -1000 -1000 -10
"""


def test_lines_come_back_as_they_were_read(tmp_path):
    (tmp_path / "a.txt").write_text(LINES)
    labels = read_object_labels(tmp_path / "a.txt")
    assert "".join(f"{label}\n" for label in labels) == LINES
    assert [label.has_box for label in labels] == [True, True, False]
    (tmp_path / "b.txt").write_text(LINES.splitlines()[0] + " 0.97\n\n")  # a detection's score
    assert [str(label) for label in read_object_labels(tmp_path / "b.txt")] == LINES.splitlines()[:1]


@pytest.mark.parametrize("rotation_y_rad", [-3.1, -1.6, 0.0, 0.4, 2.9])
def test_a_box_is_where_the_rules_of_kitti_put_its_corners(rotation_y_rad):
    """The corners as KITTI's development kit computes them, in the camera's frame."""
    height, width, length = 1.5, 1.7, 4.2
    bottom = (2.0, 1.6, 12.0)
    label = ObjectLabel("Car", 0, 0, 0, (0, 0, 1, 1), (height, width, length), bottom, rotation_y_rad)
    x = np.array([1, 1, -1, -1, 1, 1, -1, -1]) * length / 2
    y = np.array([0, 0, 0, 0, -1, -1, -1, -1]) * height
    z = np.array([1, -1, -1, 1, 1, -1, -1, 1]) * width / 2
    c, s = math.cos(rotation_y_rad), math.sin(rotation_y_rad)
    camera = np.column_stack([c * x + s * z, y, -s * x + c * z]) + bottom
    lidar = np.column_stack([camera[:, 2] + 0.25, -camera[:, 0], -camera[:, 1] - 0.1])
    ours = box_corners(label.lidar_box(AHEAD))[0]
    distances = np.linalg.norm(lidar[:, None] - ours[None], axis=2)
    assert distances.min(axis=1).max() < 1e-9
    assert sorted(distances.argmin(axis=1)) == list(range(8))


def test_a_box_comes_back_through_the_lidars_frame():
    label = ObjectLabel("Car", 0, 0, 0, (0, 0, 1, 1), (1.5, 1.7, 4.2), (2.0, 1.6, 12.0), 2.9)
    size_m, bottom_m, rotation_y_rad = camera_box(label.lidar_box(AHEAD), AHEAD)
    assert np.allclose([*size_m, *bottom_m, rotation_y_rad], [1.5, 1.7, 4.2, 2.0, 1.6, 12.0, 2.9])


def test_the_observation_angle_is_the_rotation_less_the_direction():
    """alpha = rotation_y - atan2(x, z), as the development kit defines it."""
    assert observation_angle((-3.0, 1.5, 3.0), 0.2) == pytest.approx(0.2 + math.pi / 4)
    assert observation_angle((3.0, 1.5, 3.0), -3.0) == pytest.approx(-3.0 - math.pi / 4 + 2 * math.pi)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("Car 0 0 0", "line 2 has 4 values, not 15"),
        ("Car 0 0 0 0 0 1 1 1 1 one 0 0 9 0", "line 2 has a value that is no number"),
        ("Car 0 900 0 0 0 1 1 1 1 1 0 0 9 0", "line 2 has a value out of its range"),
        ("Car 0 0 0 0 0 inf 1 1 1 1 0 0 9 0", "line 2 has a value out of its range"),
    ],
)
def test_a_damaged_line_is_named(tmp_path, line, problem):
    (tmp_path / "a.txt").write_text(f"{LINES.splitlines()[0]}\n{line}\n")
    with pytest.raises(AdvpipeError, match=f"a.txt: {problem}"):
        read_object_labels(tmp_path / "a.txt")
