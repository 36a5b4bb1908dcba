"""Frames of KITTI's object benchmark: clouds byte by byte, boxes where KITTI's files put them."""

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages.labels import image_labels_from_message
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import ImportSummary, import_drive
from tests.stages.import_.kitti.kitti_folders import (
    CALIBRATION,
    CAR,
    points,
    write_object_frames,
    write_png,
    write_text,
)


def imported(source: Path, out: Path, **options: object) -> ImportSummary:
    return import_drive(ImportRequest("kitti", source, ImportOptions(**options)), out)


def test_clouds_and_boxes_are_those_of_the_files(tmp_path):
    summary = imported(write_object_frames(tmp_path / "kitti"), tmp_path / "d")
    assert (summary.frames, summary.counts.objects, summary.counts.ignored) == (2, 2, 2)
    for seed, frame in enumerate(read_frames(summary.bag)):
        assert frame.stamp_ns == (seed + 1) * 5_000_000_000
        cloud = np.stack([frame.cloud[name] for name in ("x", "y", "z", "intensity")], axis=1)
        assert cloud.tobytes() == points(seed).tobytes()
        # The camera stands .25 m ahead of the LiDAR; -1.57 about the camera's downward axis is .0008 here.
        assert np.allclose(frame.boxes.geometry[0], [10, -2, -1.7 + 0.75, 4, 1.6, 1.5, -0.000796], atol=1e-6)
        assert frame.boxes.ids == (f"{('000003', '000007')[seed]}/0",)
        assert frame.uncounted.boxes.class_names == ("Van",)


def test_only_what_camera_2_shows_outside_dont_care_counts(tmp_path):
    frame = next(read_frames(imported(write_object_frames(tmp_path / "kitti"), tmp_path / "d").bag))
    counts = frame.uncounted.coverage.counts
    ahead, behind, far_left = [10, -2, -1], [-10, -2, -1], [10, 20, -1]
    # Pixels 100 to 140 from the left and 150 to 180 from the top are a DontCare, at any distance.
    u, v, depth = 120, 165, 30.0
    x, y = (u * (depth + 0.002) - 42 - 600 * depth) / 700, (v * (depth + 0.002) - 0.7 - 180 * depth) / 700
    ignored = [depth + 0.25, -x, -y]
    assert counts(np.array([ahead, behind, far_left, ignored])).tolist() == [True, False, False, False]
    assert counts(np.array([[depth + 0.25, -x, -y - 2]])).tolist() == [True]


def test_image_labels_keep_what_boxes_cannot_say(tmp_path):
    bag = imported(write_object_frames(tmp_path / "kitti"), tmp_path / "d").bag
    _, message = next(BagReader(bag).messages("/ego/ground_truth/camera_2/labels"))
    car, van, dont_care = image_labels_from_message(message)
    assert (car.id, car.class_name, car.edges_px) == ("000003/0", "Car", (600.0, 170.0, 700.0, 260.0))
    assert (car.truncation, car.occlusion, car.observation_angle_rad) == (0.1, 1, -1.57)
    assert (van.class_name, van.occlusion) == ("Van", 0)
    assert (dont_care.id, dont_care.class_name, dont_care.truncation) == ("", "DontCare", -1.0)
    _, info = next(BagReader(bag).messages("/ego/camera_2/camera_info"))
    assert (info.width, info.height) == (1242, 375)
    assert info.p.tolist() == [700, 0, 600, 42, 0, 700, 180, 0.7, 0, 0, 1, 0.002]


def test_the_size_of_a_picture_is_that_of_its_file(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    write_png(root / "training" / "image_2" / "000003.png", 1224, 370)
    summary = imported(root, tmp_path / "d")
    assert any("1 of 2 frames lack a picture" in note for note in summary.notes)
    sizes = [(m.width, m.height) for _, m in BagReader(summary.bag).messages("/ego/camera_2/camera_info")]
    assert sizes == [(1224, 370), (1242, 375)]
    (root / "training" / "image_2" / "000003.png").write_bytes(b"GIF89a")
    with pytest.raises(AdvpipeError, match=r"000003\.png: is no PNG"):
        imported(root, tmp_path / "e")


def test_a_split_chooses_frames_and_their_order(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    write_text(root / "ImageSets" / "val.txt", "000007\n")
    write_text(root / "ImageSets" / "none.txt", "\n")
    write_text(root / "ImageSets" / "far.txt", "000009\n")
    frames = list(read_frames(imported(root, tmp_path / "d", split="val").bag))
    assert [frame.boxes.ids for frame in frames] == [("000007/0",)]
    assert imported(root / "training", tmp_path / "e", split="val").frames == 1
    for split, problem in {
        "none": "none.txt is empty",
        "far": r"000009\.bin is missing",
        "vla": r"no ImageSets/vla\.txt; it has far, none, val",
    }.items():
        with pytest.raises(UsageError, match=problem):
            imported(root, tmp_path / "f", split=split)


def test_frames_of_the_test_set_have_no_ground_truth(tmp_path):
    root = write_object_frames(write_object_frames(tmp_path / "kitti"), ("000001",), "testing")
    summary = imported(root, tmp_path / "d", split="testing")
    assert summary.frames == 1
    assert "no label_2: the frames have no ground truth" in summary.notes
    assert "/ego/ground_truth/objects" not in BagReader(summary.bag).topics


def test_classes_can_be_chosen(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    bag = imported(root, tmp_path / "d", classes={"Van": "truck", "DontCare": "drop"}).bag
    frame = next(read_frames(bag))
    assert frame.boxes.labels.tolist() == [0, 1]
    assert frame.uncounted.coverage.ignored == ()
    write_text(root / "training" / "label_2" / "000003.txt", CAR.replace("Car", "Tractor"))
    with pytest.raises(AdvpipeError, match=r"000003\.txt: unknown class 'Tractor'.*--class Tractor=car"):
        imported(root, tmp_path / "e")


def _remove(file: str) -> object:
    return lambda root: (root / file).unlink()


def _write(file: str, text: str) -> object:
    return lambda root: write_text(root / file, text)


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (_remove("training/calib/000003.txt"), r"calib/000003\.txt is missing"),
        (_remove("training/label_2/000007.txt"), r"label_2/000007\.txt is missing"),
        (_remove("training/velodyne/000007.bin"), r"velodyne/000007\.bin is missing.*label has no cloud"),
        (_write("training/calib/000003.txt", "P2: 1 2\n"), r"000003\.txt: the line P2 .* 12 finite numbers"),
        (_write("training/calib/000003.txt", CALIBRATION.replace("R0_rect", "R")), "has no line R0_rect"),
        (_write("training/label_2/000003.txt", CAR + " 1 2"), "line 1 has 17 values, not 15"),
        (_write("training/label_2/000003.txt", CAR.replace("4.00", "four")), "line 1 has a value that is no"),
        (_write("training/label_2/000003.txt", CAR.replace("4.00", "nan")), "line 1 has a value out of its"),
        (_write("training/label_2/000003.txt", CAR.replace("4.00", "-1")), "a Car has no 3D box"),
        (_write("training/velodyne/000003.bin", "abcdef"), r"000003\.bin: 6 bytes are not a whole number"),
        (
            _write("training/velodyne/000003.bin", ""),
            "cloud of ego/lidar has no points; restore it",
        ),
    ],
)
def test_damaged_folders_fail_with_one_line(tmp_path, damage, problem):
    root = write_object_frames(tmp_path / "kitti")
    damage(root)
    with pytest.raises(AdvpipeError, match=problem) as failure:
        imported(root, tmp_path / "d")
    assert "\n" not in str(failure.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kitti"]
