"""Raw drives: time stamps, poses over ground, tracklets with ids and velocities."""

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.import_.kitti.form import KittiForm
from advpipe.stages.import_.kitti.oxts import OxtsPoses
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from tests.stages.import_.kitti.kitti_folders import write_raw_drive, write_text


def test_stamps_poses_and_tracklets_come_from_the_files(tmp_path):
    drive = write_raw_drive(tmp_path / "2011_09_26", frames=7)
    frames = list(KittiForm().open(drive, ImportOptions()).frames())
    stamps_ns = np.array([frame.stamp_ns for frame in frames])
    assert str(np.datetime64(int(stamps_ns[0]), "ns")) == "2011-09-26T13:02:25.000000000"
    assert np.diff(stamps_ns).tolist() == [100_000_000] * 6
    poses = [frame.vehicles["ego"].map_SE3_base for frame in frames]
    # 1 m north a frame; the LiDAR, and the base 1.73 m below, stand .8 m ahead of the inertial unit.
    moved = [pose[:3, 3] - poses[0][:3, 3] for pose in poses]
    assert np.allclose(moved, [[0, k, 0] for k in range(7)], atol=1e-4)
    assert np.allclose(poses[0][:3, 3], [0.3, 0.8, 0.8 - 1.73], atol=1e-9)
    assert np.allclose(poses[0][:3, 0], [0, 1, 0], atol=1e-9)
    boxes = frames[3].vehicles["ego"].boxes
    assert boxes.ids == ("tracklet_0", "tracklet_1")
    assert np.allclose(boxes.geometry[0], [17, 2, -1.7 + 0.75, 4, 1.6, 1.5, 0.1])
    assert np.allclose(boxes.velocity_mps, [[0, 0, 0], [5, 0, 0]], atol=1e-3)
    assert frames[0].vehicles["ego"].ignored.class_names == ("Person_sitting",)
    assert frames[1].vehicles["ego"].ignored.class_names == ()


def test_the_bag_has_velocities_and_image_labels(tmp_path):
    write_raw_drive(tmp_path / "2011_09_26")
    summary = import_drive(ImportRequest("kitti", tmp_path, ImportOptions()), tmp_path / "d")
    frame = next(read_frames(summary.bag))
    assert np.allclose(frame.boxes.velocity_mps, [[0, 0, 0], [5, 0, 0]], atol=1e-3)
    labels = (
        next(KittiForm().open(tmp_path, ImportOptions()).frames()).vehicles["ego"].cameras["camera_2"].labels
    )
    assert [(label.class_name, label.occlusion) for label in labels] == [
        ("Car", 0),
        ("Car", 1),
        ("Person_sitting", 0),
    ]
    left, _, right, bottom = labels[0].edges_px
    # The car at 20 m, 2 m to the left: its middle is about 700 * -2 / 20 pixels left of the image's.
    assert 480 < left < 600 - 70 < right < 600
    assert bottom == pytest.approx(180 + 700 * 1.7 / 17.8, abs=3)


def test_poses_do_not_depend_on_how_mercator_is_scaled(tmp_path):
    """At 49 degrees north, a degree of longitude is cos(49 degrees) of one at the equator."""
    degree_m = 6378137.0 * np.pi / 180
    for frame, (latitude, longitude) in enumerate([(49.0, 8.4), (49.0, 8.4 + 10 / degree_m)]):
        values = [latitude, longitude, 110.0, 0.1, 0.0, 0.0, *[0.0] * 24]
        write_text(tmp_path / "data" / f"{frame:010d}.txt", " ".join(map(repr, values)))
    pose = OxtsPoses(tmp_path, 0).map_SE3_imu(1)
    assert np.allclose(pose[:3, 3], [10 * np.cos(np.radians(49)), 0, 0], atol=1e-6)
    assert np.allclose(pose[:3, :3] @ [0, 1, 0], [0, np.cos(0.1), np.sin(0.1)])  # rolled: left side up


def test_a_missing_cloud_keeps_the_stamps_of_the_others(tmp_path):
    drive = write_raw_drive(tmp_path / "2011_09_26", frames=4)
    (drive / "velodyne_points" / "data" / "0000000001.bin").unlink()
    source = KittiForm().open(drive, ImportOptions())
    frames = list(source.frames())
    assert [frame.source_name for frame in frames] == ["0000000000", "0000000002", "0000000003"]
    assert frames[1].stamp_ns - frames[0].stamp_ns == 200_000_000
    assert "clouds missing in between: 1" in source.notes


def test_without_labels_and_poses_the_clouds_remain(tmp_path):
    drive = write_raw_drive(tmp_path / "2011_09_26")
    (drive / "tracklet_labels.xml").unlink()
    (drive / "oxts").rename(tmp_path / "elsewhere")
    source = KittiForm().open(drive, ImportOptions())
    vehicle = next(source.frames()).vehicles["ego"]
    assert vehicle.boxes is None
    assert vehicle.map_SE3_base is None
    assert sum("no " in note for note in source.notes) == 2


@pytest.mark.parametrize(
    ("file", "text", "problem"),
    [
        (
            "../calib_velo_to_cam.txt",
            None,
            r"calib_velo_to_cam\.txt is missing; unpack the date's calibration",
        ),
        ("../calib_velo_to_cam.txt", f"R: {'0 ' * 9}\nT: 0 0 0\n", r"velo_to_cam\.txt: R is no rotation"),
        ("../calib_velo_to_cam.txt", "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n", "looks 90° aside"),
        ("../calib_cam_to_cam.txt", "P_rect_00: 1\n", "line P_rect_00 does not have 12 finite numbers"),
        ("velodyne_points/timestamps.txt", "2011-09-26 13:02:25\n", r"1 time stamps, but there is a cloud"),
        ("velodyne_points/timestamps.txt", "yesterday\n", "line 1 is no time stamp"),
        ("velodyne_points/timestamps.txt", None, "cannot be read"),
        ("oxts/data/0000000001.txt", None, r"0000000001\.txt is missing; restore it"),
        ("oxts/data/0000000001.txt", "49 8.4 up", "line 1 does not have 30 finite numbers"),
        ("tracklet_labels.xml", "<boost_serialization><trackl", r"no valid tracklet_labels\.xml"),
        ("tracklet_labels.xml", '<!DOCTYPE a [<!ENTITY b "c">]><a/>', "declares entities"),
        ("velodyne_points/data/1.bin", "", r"1\.bin: KITTI names its clouds by 10 digits"),
    ],
)
def test_damaged_drives_fail_with_one_line(tmp_path, file, text, problem):
    drive = write_raw_drive(tmp_path / "2011_09_26")
    damaged = Path(drive, file).resolve()
    if text is None:
        damaged.unlink()
    else:
        write_text(damaged, text)
    with pytest.raises(AdvpipeError, match=problem) as failure:
        import_drive(ImportRequest("kitti", drive, ImportOptions()), tmp_path / "d")
    assert "\n" not in str(failure.value)
