"""KITTI's folders from bags: what was imported comes back, a simulated drive within KITTI's rounding."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from advpipe import attack
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.kitti.object_label import read_object_labels
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from tests.stages.import_.kitti.kitti_folders import (
    CAR,
    DONT_CARE,
    VAN,
    points,
    write_object_frames,
    write_png,
    write_raw_drive,
    write_text,
)

SAMPLE = Path(__file__).parents[4] / "sample"


def imported(source: Path, out: Path, **options: object) -> Path:
    return import_drive(ImportRequest("kitti", source, ImportOptions(**options)), out).data_set


def test_an_imported_frame_comes_back(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    write_png(root / "training" / "image_2" / "000003.png", 1224, 370)
    summary = export_bags(imported(root, tmp_path / "d"), "kitti", tmp_path / "out")
    assert (summary.bags, summary.frames, summary.objects) == (1, 2, 4)
    training = tmp_path / "out" / "clean" / "training"
    for seed, name in enumerate(("000003", "000007")):
        assert (training / "velodyne" / f"{name}.bin").read_bytes() == points(seed).tobytes()
        assert (training / "label_2" / f"{name}.txt").read_text() == f"{CAR}\n{VAN}\n{DONT_CARE}\n"
        ours, theirs = (training / "calib" / f"{name}.txt").read_text(), root / "training/calib/000003.txt"
        for line, expected in zip(ours.splitlines()[:6], theirs.read_text().splitlines()[:6], strict=True):
            assert line.split()[0] == expected.split()[0]
            assert np.allclose(*([*map(float, text.split()[1:])] for text in (line, expected)), atol=1e-12)
    again = imported(tmp_path / "out" / "clean", tmp_path / "again")
    sizes = [frame.uncounted.coverage.labelled[0] for frame in read_frames(again / "clean")]
    first = [frame.uncounted.coverage.labelled[0] for frame in read_frames(tmp_path / "d" / "clean")]
    assert all(np.allclose(one.planes, other.planes) for one, other in zip(sizes, first, strict=True))


def test_a_simulated_drive_comes_back_within_the_rounding(tmp_path):
    export_bags(SAMPLE / "clean", "kitti", tmp_path / "out")
    back = imported(tmp_path / "out" / "clean", tmp_path / "back", interval_s=0.1) / "clean"
    compared = 0
    for before, after in zip(read_frames(SAMPLE / "clean"), read_frames(back), strict=True):
        for name in ("x", "y", "z", "intensity"):
            assert before.cloud[name].tobytes() == after.cloud[name].tobytes()
        in_view = after.uncounted.coverage.counts(before.boxes.geometry[:, :3])
        expected = before.boxes[in_view]
        assert after.boxes.labels.tolist() == expected.labels.tolist()
        change = after.boxes.geometry - expected.geometry
        change[:, 6] = (change[:, 6] + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(change[:, [3, 4, 5, 6]]).max(initial=0) <= 0.005 + 1e-9
        assert np.abs(change[:, :2]).max(initial=0) <= 0.005 + 1e-9
        assert np.abs(change[:, 2]).max(initial=0) <= 0.0075 + 1e-9  # bottom and height are rounded
        compared += len(expected)
    assert compared > 0


def test_labels_of_a_virtual_camera_have_all_that_kitti_asks(tmp_path):
    export_bags(SAMPLE / "clean", "kitti", tmp_path / "out")
    training = tmp_path / "out" / "clean" / "training"
    labels = [label for file in training.glob("label_2/*.txt") for label in read_object_labels(file)]
    assert {label.class_name.lower() for label in labels} <= set(CLASSES)
    assert {label.occlusion for label in labels} <= {0, 1, 2, 3}
    for label in labels:
        left, top, right, bottom = label.edges_px
        assert 0 <= left < right <= 1241
        assert 0 <= top < bottom <= 374
        assert 0 <= label.truncation <= 1
        x, _, z = label.bottom_m
        angle = label.rotation_y_rad - np.arctan2(x, z) - label.alpha_rad
        assert abs((angle + np.pi) % (2 * np.pi) - np.pi) < 0.02


def test_an_attacked_bag_has_the_same_names_and_labels(tmp_path):
    data_set = imported(write_object_frames(tmp_path / "kitti"), tmp_path / "d")
    attack(data_set, type="detach", ratio=0.1, recipe="random")
    summary = export_bags(data_set, "kitti", tmp_path / "out")
    assert summary.bags == 2
    attacked = next(folder for folder in (tmp_path / "out").iterdir() if folder.name.startswith("detach"))
    for folder in ("calib", "image_2", "label_2"):
        for file in (tmp_path / "out" / "clean" / "training" / folder).iterdir():
            assert file.read_bytes() == (attacked / "training" / folder / file.name).read_bytes()
    for name in ("000003", "000007"):
        clean, left = (
            np.fromfile(folder / "training" / "velodyne" / f"{name}.bin", "<f4").reshape(-1, 4)
            for folder in (tmp_path / "out" / "clean", attacked)
        )
        assert len(clean) - len(left) == 30
        assert {row.tobytes() for row in left} <= {row.tobytes() for row in clean}
    assert sets_of(attacked) == sets_of(tmp_path / "out" / "clean")


def sets_of(folder: Path) -> dict[str, list[str]]:
    return {file.stem: file.read_text().split() for file in (folder / "ImageSets").iterdir()}


def test_the_last_fifth_is_for_validation(tmp_path):
    names = tuple(f"{index:06d}" for index in range(10))
    root = write_object_frames(tmp_path / "kitti", names)
    write_text(root / "training" / "label_2" / "000004.txt", "")  # nobody is there
    summary = export_bags(imported(root, tmp_path / "d"), "kitti", tmp_path / "out")
    sets = sets_of(tmp_path / "out" / "clean")
    assert sets["trainval"] == [name for name in names if name != "000004"]
    assert (sets["val"], sets["test"]) == (["000008", "000009"], [])
    assert sets["train"] + sets["val"] == sets["trainval"]
    assert any("frames without objects (1 of 10) are not in ImageSets" in note for note in summary.notes)


def test_tracklets_keep_what_was_seen(tmp_path):
    write_raw_drive(tmp_path / "2011_09_26")
    export_bags(imported(tmp_path / "2011_09_26", tmp_path / "d"), "kitti", tmp_path / "out")
    first = read_object_labels(tmp_path / "out" / "clean" / "training" / "label_2" / "000000.txt")
    seen = [(label.class_name, label.occlusion) for label in first]
    assert seen == [("Car", 0), ("Car", 1), ("Person_sitting", 0)]
    assert first[0].bottom_m == pytest.approx((-2.0, 1.7, 19.75), abs=0.005)


def test_the_configurations_name_the_clean_folder(tmp_path):
    export_bags(SAMPLE / "clean", "kitti", tmp_path / "out")
    config = yaml.safe_load((tmp_path / "out" / "openpcdet" / "second.yaml").read_text())
    assert config["DATA_CONFIG"]["DATA_PATH"] == "../data/advpipe/clean"
    for script in ("openpcdet/create_infos.py", "mmdet3d/second.py"):
        compile((tmp_path / "out" / script).read_text(), script, "exec")
