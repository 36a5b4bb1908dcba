"""Argoverse 2: what the log says is what the drive says; what is wrong is one line."""

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.stages.import_.av2.form import Av2Form
from advpipe.stages.import_.options import ImportOptions
from tests.stages.import_.av2.tiny_av2 import SWEEPS, stamps, sweep, tables_of, write_av2, write_table
from tests.stages.import_.importing import drive_frames, import_form


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_av2(tmp_path_factory.mktemp("val") / "log-1")


def test_points_keep_the_ego_vehicle_s_coordinates(log):
    frames = drive_frames("av2", log)
    assert [frame.stamp_ns for frame in frames] == stamps()
    for k, frame in enumerate(frames):
        cloud, columns = frame.vehicles["ego"].clouds["lidar"], sweep(k)
        for name in ("x", "y", "z"):
            assert cloud[name].tolist() == columns[name].tolist()
        assert cloud["ring"].tolist() == columns["laser_number"].tolist()
        assert cloud["intensity"] == pytest.approx(columns["intensity"] / 255, abs=1e-7)
        assert cloud["time"] == pytest.approx(columns["offset_ns"] / 1e9, abs=1e-8)


def test_boxes_are_in_the_frame_of_the_points(log):
    vehicle = drive_frames("av2", log)[1].vehicles["ego"]
    assert vehicle.boxes is not None
    assert vehicle.boxes_frame == "ego/lidar"
    assert [CLASSES[label] for label in vehicle.boxes.labels] == ["car", "cyclist", "truck"]
    assert vehicle.boxes.ids == ("track-0", "track-2", "track-3")
    assert vehicle.boxes.geometry[0, :6].tolist() == [10.25, -3.5, 0.6, 4.5, 1.9, 1.6]
    assert vehicle.boxes.geometry[:, 6] == pytest.approx([-1.0, -0.4, -0.1], abs=1e-12)
    assert vehicle.ignored.class_names == ("BICYCLE", "SIGN")
    assert vehicle.lidar_points is not None
    assert vehicle.lidar_points.tolist() == [0, 14, 21]


def test_what_keeps_its_place_beside_a_moving_vehicle_moves_with_it(log):
    """The vehicle drives 1.1 m in 0.1 s and turns by 0.1 rad/s; so do the boxes, 10.25 m ahead."""
    boxes = drive_frames("av2", log)[1].vehicles["ego"].boxes
    assert boxes is not None
    yaw = 0.21
    along_x = 11.0 * np.array([np.cos(yaw), -np.sin(yaw)])  # of the city, in the vehicle's frame
    expected = along_x + 0.1 * np.array([3.5, 10.25])
    assert boxes.velocity_mps[0, :2] == pytest.approx(expected, abs=1e-3)


def test_the_bag_knows_poses_mounts_and_cameras(log, tmp_path):
    from advpipe.pipeline.bag.reader import BagReader
    from advpipe.pipeline.messages.build import se3_from_transform

    summary = import_form("av2", log.parent, tmp_path / "d", lidar_height_m=0.4)
    reader = BagReader(summary.bag)
    mounts = next(reader.messages("/tf_static"))[1].transforms
    assert {each.child_frame_id for each in mounts} == {
        "ego/lidar",
        "ego/up_lidar",
        "ego/down_lidar",
        "ego/ring_front_center",
    }
    base_SE3_lidar = se3_from_transform(mounts[0].transform)
    assert base_SE3_lidar[:3, 3].tolist() == [0, 0, 0.4]
    map_SE3_base = se3_from_transform(next(reader.messages("/tf"))[1].transforms[0].transform)
    assert (map_SE3_base @ base_SE3_lidar)[:3, 3] == pytest.approx([1468.8, 211.5, 13.5], abs=1e-12)
    info = next(reader.messages("/ego/ring_front_center/camera_info"))[1]
    assert (info.width, info.height, info.k[0], info.d.tolist()) == (
        1550,
        2048,
        1687.5,
        [-0.25, -0.1, 0, 0, 0.2],
    )
    frames = list(read_frames(summary.bag))
    assert [len(frame.boxes) for frame in frames] == [3] * SWEEPS
    assert "0.4 m above the ground" in " ".join(summary.notes)


def test_sweeps_without_labels_are_left_out(tmp_path):
    tables = tables_of()
    first = np.array(tables["annotations"]["timestamp_ns"]) > stamps()[0]
    tables["annotations"] = {name: np.array(column)[first] for name, column in tables["annotations"].items()}
    log = write_av2(tmp_path / "log", tables)
    assert [frame.stamp_ns for frame in drive_frames("av2", log)] == stamps()[1:]
    assert "Sweeps without labels are left out: 1." in Av2Form().open(log, ImportOptions()).notes
    (log / "annotations.feather").unlink()
    unlabelled = drive_frames("av2", log)
    assert len(unlabelled) == SWEEPS
    assert unlabelled[0].vehicles["ego"].boxes is None


def test_one_of_several_logs_is_chosen(log):
    write_av2(log.parent / "log-2")
    with pytest.raises(UsageError, match=r"has 2 logs; choose one .*: log-1, log-2"):
        Av2Form().open(log.parent, ImportOptions())
    assert Av2Form().open(log.parent, ImportOptions(drive="log-2")).name == "log-2"
    with pytest.raises(UsageError, match="is one log"):
        Av2Form().open(log, ImportOptions(drive="log-2"))


def with_column(log: Path, name: str, **columns) -> None:
    write_table(log / f"{name}.feather", {**tables_of()[name], **columns})


def without_column(log: Path, name: str, column: str) -> None:
    write_table(log / f"{name}.feather", {k: v for k, v in tables_of()[name].items() if k != column})


def with_sweep(log: Path, **columns) -> None:
    write_table(log / "sensors" / "lidar" / f"{stamps()[2]}.feather", {**sweep(2), **columns})


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda log: (log / "calibration" / "egovehicle_SE3_sensor.feather").unlink(), "is missing"),
        (
            lambda log: (log / "sensors/lidar" / f"{stamps()[1]}.feather").unlink(),
            "though annotations.feather",
        ),
        (lambda log: (log / "sensors/lidar/preview.feather").write_text(""), "not named by a time stamp"),
        (
            lambda log: (log / "annotations.feather").write_text("no table"),
            "cannot be read as a Feather file",
        ),
        (lambda log: without_column(log, "annotations", "track_uuid"), "no column track_uuid"),
        (lambda log: with_column(log, "annotations", category=[1.0] * 20), "category is of type double"),
        (
            lambda log: with_column(log, "annotations", length_m=[None] + [1.0] * 19),
            "1 values of length_m are missing",
        ),
        (lambda log: with_column(log, "annotations", length_m=[-1.0] * 20), "a box has the size -1 m"),
        (
            lambda log: with_column(log, "city_SE3_egovehicle", tx_m=[0.0, 900, 0, 0, 0]),
            "the pose of ego jumps 900",
        ),
        (lambda log: with_column(log, "city_SE3_egovehicle", timestamp_ns=[0, 1, 2, 3, 4]), "has no pose"),
        (lambda log: with_column(log, "city_SE3_egovehicle", qw=[0.0] * 5, qz=[0.0] * 5), "no quaternion"),
        (
            lambda log: with_sweep(log, intensity=np.full(500, 4000, np.uint16)),
            "intensities from 4000 to 4000",
        ),
        (
            lambda log: with_sweep(log, x=sweep(2)["x"].astype(np.float32) * 1e3, y=np.full(500, 9e4)),
            "give metres",
        ),
        (lambda log: with_sweep(log, laser_number=np.full(500, -1, np.int32)), "lasers from -1"),
        (lambda log: with_sweep(log, **{name: sweep(2)[name][:0] for name in sweep(2)}), "has no points"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, damage, message):
    log = write_av2(tmp_path / "log")
    damage(log)
    with pytest.raises(AdvpipeError, match=message) as caught:
        import_form("av2", log, tmp_path / "d")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "d").exists()


def test_a_folder_of_another_form_is_refused(tmp_path):
    with pytest.raises(UsageError, match="no sensor log of Argoverse 2 and holds none"):
        import_form("av2", tmp_path, tmp_path / "d")
