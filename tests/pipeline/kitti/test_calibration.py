"""KITTI's calibration files: read, written, and where they put points."""

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.kitti.calibration import format_object_calibration, read_object_calibration
from tests.stages.import_.kitti.kitti_folders import CALIBRATION, IMU_TO_VELO, R0, VELO_TO_CAM, P


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


ZEROS = " ".join(["0"] * 12)


@pytest.mark.parametrize(
    ("key", "numbers", "problem"),
    [
        ("R0_rect", " ".join(["0"] * 9), "R0_rect is no rotation; restore it"),
        ("R0_rect", "2 0 0 0 1 0 0 0 1", "R0_rect is no rotation"),
        ("R0_rect", "-1 0 0 0 1 0 0 0 1", "R0_rect is no rotation"),
        ("Tr_velo_to_cam", ZEROS, "Tr_velo_to_cam is no rotation"),
        ("Tr_imu_to_velo", "2" + IMU_TO_VELO[1:], "Tr_imu_to_velo is no rotation"),
        ("P2", ZEROS, "P2 is no projection"),
        ("P1", "700 0 600 0 0 700 180 0 0 0 0 1", "P1 is no projection"),
        ("P1", "none", "P1 does not have 12 finite numbers"),
        ("Tr_velo_to_cam", "1 0 0 0 0 1 0 0 0 0 1 0", r"by Tr_velo_to_cam, the camera looks 90° aside"),
        ("Tr_velo_to_cam", "0 1 0 0 0 0 -1 0 -1 0 0 0", "the camera looks 180° aside"),
    ],
)
def test_a_matrix_that_cannot_be_is_named(tmp_path, key, numbers, problem):
    lines = [line for line in CALIBRATION.splitlines() if not line.startswith(f"{key}:")]
    (tmp_path / "a.txt").write_text("\n".join([*lines, f"{key}: {numbers}"]))
    with pytest.raises(AdvpipeError, match=rf"a\.txt: .*{problem}") as failure:
        read_object_calibration(tmp_path / "a.txt")
    assert "\n" not in str(failure.value)


def test_zeros_of_converters_stand_for_what_they_do_not_know(tmp_path):
    """As nuScenes' converter to KITTI's form writes them."""
    text = CALIBRATION.replace(f"P1: {P}", f"P1: {ZEROS}").replace(IMU_TO_VELO, ZEROS)
    (tmp_path / "a.txt").write_text(text)
    calibration = read_object_calibration(tmp_path / "a.txt")
    assert sorted(calibration.projections) == [0, 2, 3]
    assert calibration.lidar_SE3_imu.tolist() == np.eye(4).tolist()


def test_rounded_rotations_are_taken(tmp_path):
    """A small rotation with five decimals."""
    rounded = "0.99992 0.00984 -0.00745 -0.00987 0.99994 -0.00428 0.0074 0.00435 0.99996"
    (tmp_path / "a.txt").write_text(CALIBRATION.replace(f"R0_rect: {R0}", f"R0_rect: {rounded}"))
    assert read_object_calibration(tmp_path / "a.txt").camera_SE3_lidar[:3].ravel().tolist() == [
        float(number) for number in VELO_TO_CAM.split()
    ]
