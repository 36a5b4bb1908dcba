"""Sequences of KITTI's odometry benchmark: poses of the camera become those of the vehicle."""

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import has_ground_truth, read_frames
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.import_.kitti.form import KittiForm
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from tests.stages.import_.kitti.kitti_folders import write_odometry, write_text


def test_poses_of_the_camera_become_those_of_the_base(tmp_path):
    write_odometry(tmp_path)
    frames = list(KittiForm().open(tmp_path, ImportOptions()).frames())
    assert [frame.stamp_ns for frame in frames] == [0, 100_000_000, 200_000_000]
    first, second, third = (frame.vehicles["ego"].map_SE3_base for frame in frames)
    assert np.allclose(first, np.eye(4))
    assert np.allclose(third[:3, 3] - second[:3, 3], [1, 0, 0])
    # Turned left by .1 rad about the camera, which is .25 m ahead of the base.
    assert np.allclose(second[:3, 0], [np.cos(0.1), np.sin(0.1), 0])
    assert np.allclose(second[:3, 3], [1.25 - 0.25 * np.cos(0.1), -0.25 * np.sin(0.1), 0])


def test_a_sequence_becomes_a_bag_without_ground_truth(tmp_path):
    write_odometry(tmp_path)
    summary = import_drive(ImportRequest("kitti", tmp_path, ImportOptions()), tmp_path / "d")
    assert not has_ground_truth(summary.bag)
    assert len(list(read_frames(summary.bag))) == 3
    (tmp_path / "poses" / "04.txt").unlink()
    source = KittiForm().open(tmp_path, ImportOptions())
    assert next(source.frames()).vehicles["ego"].map_SE3_base is None
    assert any("no poses" in note for note in source.notes)


@pytest.mark.parametrize(
    ("file", "text", "problem"),
    [
        ("sequences/04/calib.txt", None, r"calib\.txt is missing"),
        ("sequences/04/calib.txt", "P0: 1\n", "has no line Tr"),
        ("sequences/04/calib.txt", f"Tr: {'0 ' * 12}\n", r"calib\.txt: Tr is no rotation; restore it"),
        ("sequences/04/times.txt", "0\n", r"times\.txt has 1 lines, but there is a cloud 000002\.bin"),
        ("poses/04.txt", "1 0 0 0 0 1 0 0 0 0 1\n", "line 1 does not have 12 finite numbers"),
        ("sequences/04/times.txt", "0\n0.2\n0.1\n", "is not after that of"),
        (
            "poses/04.txt",
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 900\n1 0 0 0 0 1 0 0 0 0 1 2",
            "jumps",
        ),
    ],
)
def test_damaged_sequences_fail_with_one_line(tmp_path, file, text, problem):
    write_odometry(tmp_path)
    if text is None:
        (tmp_path / file).unlink()
    else:
        write_text(tmp_path / file, text)
    with pytest.raises(AdvpipeError, match=problem) as failure:
        import_drive(ImportRequest("kitti", tmp_path, ImportOptions()), tmp_path / "d")
    assert "\n" not in str(failure.value)
