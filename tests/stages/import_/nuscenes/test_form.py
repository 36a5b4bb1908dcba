"""nuScenes: what the tables say is what the drive says; what is wrong is one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.stages.import_.nuscenes.form import NuscenesForm
from advpipe.stages.import_.options import ImportOptions
from tests.stages.import_.importing import drive_frames, import_form
from tests.stages.import_.nuscenes.tiny_nuscenes import (
    SAMPLES,
    START_US,
    STEP_US,
    points,
    tables_of,
    write_nuscenes,
)

SCENE = "scene-0061"


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_nuscenes(tmp_path_factory.mktemp("nuscenes"))


def test_key_frames_alone_become_frames_with_the_file_s_points(source):
    frames = drive_frames("nuscenes", source, drive=SCENE)
    assert [frame.stamp_ns for frame in frames] == [(START_US + k * STEP_US) * 1000 for k in range(SAMPLES)]
    for k, frame in enumerate(frames):
        table, cloud = points(3 * k), frame.vehicles["ego"].clouds["lidar"]  # two other rows a key frame
        for place, name in enumerate(("x", "y", "z")):
            assert cloud[name].tobytes() == table[:, place].tobytes()
        assert cloud["intensity"].tolist() == (table[:, 3] / np.float32(255)).tolist()
        assert cloud["ring"].tolist() == table[:, 4].tolist()


def test_boxes_keep_the_map_s_coordinates_and_their_instances(source):
    vehicle = drive_frames("nuscenes", source, drive=SCENE)[2].vehicles["ego"]
    assert vehicle.boxes is not None
    assert vehicle.boxes_frame == "map"
    assert vehicle.boxes.ids == tuple(f"{SCENE}-i{row}" for row in (0, 1, 4))
    assert [CLASSES[label] for label in vehicle.boxes.labels] == ["car", "cyclist", "truck"]
    assert vehicle.boxes.geometry[0, :6].tolist() == [424.123, 1190.5, 0.9, 4.6, 1.9, 1.7]  # length first
    assert vehicle.boxes.geometry[:, 6] == pytest.approx([-1.2, -0.7, 0.8], abs=1e-12)
    assert vehicle.ignored.class_names == ("vehicle.bicycle/cycle.without_rider", "vehicle.trailer")
    assert vehicle.lidar_points is not None
    assert vehicle.lidar_points.tolist() == [2, 12, 42]


def test_velocities_are_differences_of_neighbours(source):
    frames = drive_frames("nuscenes", source, drive=SCENE)
    first, last = (frames[k].vehicles["ego"].boxes for k in (0, 3))
    assert first is not None
    assert last is not None
    assert first.velocity_mps[0] == pytest.approx([4.0, 0, 0])  # 4 m to the third sample, in 1 s
    assert last.velocity_mps[0] == pytest.approx([4.0, 0, 0])
    assert first.velocity_mps[2].tolist() == [0, 0, 0]


def test_the_user_s_classes_come_first(source):
    options = {
        "drive": SCENE,
        "classes": {"vehicle.trailer": "truck", "vehicle.bicycle/cycle.without_rider": "drop"},
    }
    vehicle = drive_frames("nuscenes", source, **options)[0].vehicles["ego"]
    assert vehicle.boxes is not None
    assert [CLASSES[label] for label in vehicle.boxes.labels] == ["car", "cyclist", "truck", "truck"]
    assert len(vehicle.ignored) == 0


def test_the_bag_holds_the_same_boxes_and_clouds(source, tmp_path):
    summary = import_form("nuscenes", source / "v1.0-mini", tmp_path / "d", drive=SCENE)
    assert (summary.frames, summary.counts.objects, summary.counts.ignored) == (4, 11, 8)
    assert summary.licence == "CC-BY-NC-SA-4.0"
    drive = drive_frames("nuscenes", source, drive=SCENE)
    for frame, read in zip(drive, read_frames(summary.bag), strict=True):
        assert read.cloud.tobytes() == frame.vehicles["ego"].clouds["lidar"].tobytes()
        assert read.boxes.ids == frame.vehicles["ego"].boxes.ids
        assert np.isfinite(read.boxes.velocity_mps).all()


def test_several_scenes_are_listed(source):
    with pytest.raises(UsageError, match=r"has 2 scenes; choose one .*: scene-0061, scene-0103"):
        NuscenesForm().open(source, ImportOptions())
    with pytest.raises(UsageError, match=r"no scene 'scene-0062'; did you mean 'scene-0061'"):
        NuscenesForm().open(source, ImportOptions(drive="scene-0062"))


def test_a_scene_of_any_size_is_read_in_flat_memory(tmp_path):
    """The records of 300 other scenes, of which the tables' readers keep nothing."""
    import tracemalloc

    tables = tables_of()
    many = tables["sample_annotation"][5] | {"sample_token": "of another scene"}
    tables["sample_annotation"] += [many] * 60_000
    source = write_nuscenes(tmp_path / "n", tables)
    size = (source / "v1.0-mini" / "sample_annotation.json").stat().st_size
    tracemalloc.start()
    NuscenesForm().open(source, ImportOptions(drive=SCENE))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size > 20e6
    assert peak < 10e6


def test_unlabelled_sets_have_no_boxes_rather_than_none_around(tmp_path):
    tables = tables_of((SCENE,))
    tables["sample_annotation"], tables["instance"] = [], []
    source = write_nuscenes(tmp_path / "n", tables, "v1.0-test")
    assert drive_frames("nuscenes", source)[0].vehicles["ego"].boxes is None
    assert "v1.0-test holds no label." in NuscenesForm().open(source, ImportOptions()).notes


def spoil(source: Path, table: str, text: str) -> None:
    (source / "v1.0-mini" / f"{table}.json").write_text(text)


def changed(source: Path, table: str, **values) -> None:
    file = source / "v1.0-mini" / f"{table}.json"
    file.write_text(json.dumps([{**record, **values} for record in json.loads(file.read_text())]))


def without_table(source: Path) -> None:
    (source / "v1.0-mini" / "ego_pose.json").unlink()


def with_two_versions(source: Path) -> None:
    write_nuscenes(source, version="v1.0-trainval")


def with_a_file_missing(source: Path) -> None:
    next((source / "samples" / "LIDAR_TOP").glob("scene-0061__2*")).unlink()


def with_truncated_points(source: Path) -> None:
    file = next((source / "samples" / "LIDAR_TOP").glob("scene-0061__0*"))
    file.write_bytes(file.read_bytes()[:-7])


def with_another_scale(source: Path) -> None:
    file = next((source / "samples" / "LIDAR_TOP").glob("scene-0061__0*"))
    (points(0) * np.float32([1, 1, 1, 300, 1])).astype(np.float32).tofile(file)


def with_another_order(source: Path) -> None:
    file = next((source / "samples" / "LIDAR_TOP").glob("scene-0061__0*"))
    points(0)[:, [3, 4, 2, 2, 0]].tofile(file)


def with_pose_in_millimetres(source: Path) -> None:
    file = source / "v1.0-mini" / "ego_pose.json"
    records = json.loads(file.read_text())
    for record in records:
        record["translation"] = [1000 * value for value in record["translation"]]
    file.write_text(json.dumps(records))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (without_table, "lacks ego_pose.json"),
        (with_two_versions, "has the tables of v1.0-mini, v1.0-trainval; give one of these folders"),
        (
            with_a_file_missing,
            r"scene-0061__2.pcd.bin is missing, though v1.0-mini/sample_data.json names it",
        ),
        (with_truncated_points, "truncated"),
        (with_another_scale, r"intensities from 0 to .*, where nuScenes has 0 to 255"),
        (with_another_order, "nuScenes"),
        (with_pose_in_millimetres, "the pose of ego jumps 401"),
        (lambda s: spoil(s, "sample", "[]"), "holds no sample of scene-0061"),
        (lambda s: spoil(s, "scene", "[]"), "holds no scene"),
        (lambda s: spoil(s, "scene", "{}"), r"does not begin with '\['"),
        (lambda s: spoil(s, "sample_annotation", '[{"token": "a"'), "truncated"),
        (lambda s: spoil(s, "sample_annotation", "[7]"), "holds 7 in place of a record"),
        (lambda s: spoil(s, "attribute", '[{"token": "a", "name" "b"}, {"token": 1}]'), "not valid JSON"),
        (lambda s: changed(s, "sample_annotation", size=[1, 2]), "size: List should have at least 3 items"),
        (lambda s: changed(s, "sample_annotation", size=[1, -2, 1]), "a box has the size -2 m"),
        (lambda s: changed(s, "sample_annotation", instance_token="gone"), "no instance gone"),
        (lambda s: changed(s, "ego_pose", rotation=[0, 0, 0, 0]), "is no quaternion"),
        (lambda s: changed(s, "ego_pose", token="other"), "lacks the pose"),
        (lambda s: changed(s, "sample_data", is_key_frame=False), "no key frame of LIDAR_TOP"),
        (lambda s: changed(s, "sample_data", filename="../../etc/passwd"), "outside of the data set"),
        (lambda s: changed(s, "sample_data", timestamp=1_532_402_927_647_951_000), "it has another unit"),
        (lambda s: changed(s, "sensor", channel="LIDAR"), "has no LIDAR_TOP"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, damage, message):
    source = write_nuscenes(tmp_path / "n")
    damage(source)
    with pytest.raises(AdvpipeError, match=message) as caught:
        import_form("nuscenes", source, tmp_path / "d", drive=SCENE)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "d").exists()


def test_a_folder_of_another_form_is_refused(tmp_path):
    with pytest.raises(UsageError, match="holds no tables of nuScenes"):
        import_form("nuscenes", tmp_path, tmp_path / "d")
    with pytest.raises(UsageError, match="is not a folder"):
        import_form("nuscenes", tmp_path / "gone", tmp_path / "d")
