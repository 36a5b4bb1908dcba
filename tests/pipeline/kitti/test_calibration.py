"""KITTI's calibration files: read, written, and where they put points."""

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.kitti.calibration import format_object_calibration, read_object_calibration
from tests.stages.import_.kitti.kitti_folders import CALIBRATION


def test_points_come_to_pixels_through_all_three_matrices(tmp_path):
    (tmp_path / "a.txt").write_text(CALIBRATION)
    calibration = read_object_calibration(tmp_path / "a.txt")
    u, v, depth = calibration.image_P_lidar() @ [10.25, -2.0, 1.0, 1.0]  # in the camera: 2, -1, 10
    assert (u, v, depth) == pytest.approx((700 * 2 + 600 * 10 + 42, -700 + 180 * 10 + 0.7, 10.002))
    assert np.allclose(calibration.lidar_SE3_rectified @ calibration.rectified_SE3_lidar, np.eye(4))
    assert calibration.lidar_SE3_imu[:3, 3].tolist() == [-0.8, 0.3, -0.8]


def test_a_file_comes_back_as_it_was_read(tmp_path):
    (tmp_path / "a.txt").write_text(CALIBRATION)
    text = format_object_calibration(read_object_calibration(tmp_path / "a.txt"))
    lines = [line.split() for line in text.splitlines()]
    expected = [line.split() for line in CALIBRATION.splitlines()]
    assert [line[0] for line in lines] == [line[0] for line in expected]
    assert [list(map(float, line[1:])) for line in lines] == [list(map(float, line[1:])) for line in expected]


@pytest.mark.parametrize("key", ["P2", "R0_rect", "Tr_velo_to_cam"])
def test_a_missing_line_is_named(tmp_path, key):
    (tmp_path / "a.txt").write_text("".join(line for line in CALIBRATION.splitlines(True) if key not in line))
    with pytest.raises(AdvpipeError, match=f"a.txt: has no line {key}"):
        read_object_calibration(tmp_path / "a.txt")
