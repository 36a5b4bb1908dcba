"""Folders of clouds: order, times, poses and boxes as the files say, and folders that cannot be right."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import se3_from_quaternion, se3_from_yaw
from advpipe.pipeline.messages.build import se3_from_transform
from advpipe.stages.import_.files import PointFolderForm, natural_order
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import ImportSummary, import_drive
from advpipe.stages.verify.run import verify

sys.path.insert(0, str(Path(__file__).parent))

from point_bytes import pcd, some_points

START_NS = 1_700_000_000_123_456_789


def folder_of(folder: Path, *names: str) -> Path:
    """Clouds of these names, each of its own points."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed, name in enumerate(names):
        (folder / name).write_bytes(pcd(some_points(seed)))
    return folder


def opened(folder: Path, **options: object):
    return PointFolderForm().open(folder, ImportOptions(**options))


def imported(folder: Path, out: Path, **options: object) -> ImportSummary:
    return import_drive(ImportRequest("files", folder, ImportOptions(**options)), out)


def test_a_folder_with_all_that_may_be_in_it(tmp_path: Path) -> None:
    """Times in names, KITTI's poses, boxes in OpenPCDet's custom form: all is in the bag."""
    folder = tmp_path / "Fahrt ü"
    names = [f"{START_NS + k * 10**8}.pcd" for k in range(3)]
    folder_of(folder / "points", *names)
    poses = [se3_from_yaw((k, 2.0 * k, 0.5), 0.1 * k) for k in range(3)]
    rows = (" ".join(repr(float(v)) for v in pose[:3].ravel()) for pose in poses)
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    (folder / "labels").mkdir()
    for name in names:
        text = (
            "10 -2.5 -0.9 4.5 1.9 1.6 0.3 Vehicle a7\n20 1 -0.9 1 1 1.8 0 Pedestrian\n5 5 -1 3 2 2 0 Misc\n"
        )
        (folder / "labels" / name.replace(".pcd", ".txt")).write_text(text)
    summary = imported(folder, tmp_path / "d", lidar_height_m=1.8)
    frames = list(read_frames(summary.bag))
    assert [frame.stamp_ns for frame in frames] == [START_NS + k * 10**8 for k in range(3)]
    for k, frame in enumerate(frames):
        assert np.array_equal(frame.cloud["x"], some_points(k)["x"])
        assert np.allclose(frame.boxes.geometry[0], [10, -2.5, -0.9, 4.5, 1.9, 1.6, 0.3], rtol=0, atol=1e-14)
        assert frame.boxes.ids == ("a7", "")
        assert frame.boxes.labels.tolist() == [0, 3]
        assert frame.uncounted.boxes.class_names == ("Misc",)
    transforms = [m.transforms[0] for _, m in BagReader(summary.bag).messages("/tf")]
    for pose, transform in zip(poses, transforms, strict=True):
        expected = pose @ np.linalg.inv(se3_from_yaw((0, 0, 1.8), 0))
        assert np.allclose(se3_from_transform(transform.transform), expected, rtol=0, atol=1e-12)
    assert not verify(tmp_path / "d").findings


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("1700000000000000001.pcd", "1700000000000000003.pcd"), [1700000000000000001, 1700000000000000003]),
        (("1700000000000001.pcd", "1700000000000002.pcd"), [1700000000000001000, 1700000000000002000]),
        (("1700000000.5.pcd", "1700000000.75.pcd"), [1700000000500000000, 1700000000750000000]),
        (
            ("a17_1700000000_000000007.pcd", "a17_1700000001_000000008.pcd"),
            [1700000000 * 10**9 + 7, 1700000001 * 10**9 + 8],
        ),
        (("1700000001.pcd", "1700000002.pcd"), [1700000001 * 10**9, 1700000002 * 10**9]),
        (("000000.pcd", "000001.pcd"), [10**9, 11 * 10**8]),
        (("2.pcd", "10.pcd"), [10**9, 11 * 10**8]),
    ],
)  # fmt: skip
def test_times_in_names(names: tuple[str, ...], expected: list[int], tmp_path: Path) -> None:
    drive = opened(folder_of(tmp_path / "f", *names))
    assert list(drive.stamps_ns) == expected
    assert [file.name for file in drive.files] == list(names)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.0\n0.1036\n", [0, 103_600_000]),
        ("# s\n1700000000000000001\n1700000000000000002\n", [1700000000000000001, 1700000000000000002]),
        (
            "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.067\n",
            [1317042145964389445, 1317042146067000000],
        ),
    ],
)  # fmt: skip
def test_times_in_a_file(text: str, expected: list[int], tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "f", "0.pcd", "1.pcd")
    (folder / "times.txt").write_text(text)
    assert list(opened(folder).stamps_ns) == expected
    assert list(opened(folder, interval_s=0.5).stamps_ns) == [10**9, 15 * 10**8]


def test_poses_of_tum_are_found_by_time(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "f", "1700000000.10.pcd", "1700000000.20.pcd")
    turned = np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9])
    quaternion = " ".join(repr(float(v)) for v in turned)
    (folder / "poses.txt").write_text(
        f"1700000000.05 9 9 9 0 0 0 1\n1700000000.10 1 2 3 {quaternion}\n1700000000.21 4 5 6 0 0 0 1\n"
    )
    poses = opened(folder).poses
    assert np.allclose(poses[0], se3_from_quaternion(turned, [1, 2, 3]))
    assert poses[1][:3, 3].tolist() == [4, 5, 6]
    (folder / "poses.txt").write_text("1700000000.10 1 2 3 0 0 0 1\n")
    with pytest.raises(UsageError, match=r"no pose within 0\.1 s of the cloud"):
        opened(folder_of(folder, "1700000000.10.pcd", "1700000000.20.pcd", "1700000009.90.pcd"))


def test_names_are_in_the_order_that_people_read() -> None:
    names = ["c10.pcd", "c2.pcd", "c1.pcd", "b.pcd", "c01.pcd", "²5.pcd"]
    assert sorted(names, key=natural_order)[:5] == ["b.pcd", "c01.pcd", "c1.pcd", "c2.pcd", "c10.pcd"]


def broken(folder: Path, what: str) -> None:
    """A folder of two clouds with something wrong."""
    folder_of(folder, "000000.pcd", "000001.pcd")
    if what == "mixed":
        (folder / "000002.bin").write_bytes(bytes(160))
    elif what == "same stem":
        (folder / "000001.PCD").write_bytes(pcd(some_points()))
    elif what == "empty":
        for file in folder.iterdir():
            file.unlink()
    elif what == "two folders":
        folder_of(folder / "a", "0.pcd"), folder_of(folder / "b", "0.pcd")
        (folder / "000000.pcd").unlink(), (folder / "000001.pcd").unlink()
    elif what == "few times":
        (folder / "times.txt").write_text("0.1\n")
    elif what == "no time":
        (folder / "times.txt").write_text("0.1\nsoon\n")
    elif what == "few poses":
        (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    elif what == "odd poses":
        (folder / "poses.txt").write_text("1 2 3\n")
    elif what == "no quaternion":
        (folder / "poses.txt").write_text("1 0 0 0 0 0 0 9\n2 0 0 0 0 0 0 1\n")
    elif what == "other labels":
        (folder / "labels").mkdir()
        (folder / "labels" / "7.txt").write_text("")
    elif what == "binary text":
        (folder / "poses.txt").write_bytes(b"\xff\xfe\0")


@pytest.mark.parametrize(
    ("what", "complaint"),
    [
        ("mixed", "mixes .bin and .pcd"),
        ("same stem", "holds both"),
        ("empty", "holds no clouds"),
        ("two folders", "several folders of clouds (a/, b/)"),
        ("few times", "1 times for 2 clouds"),
        ("no time", "times.txt:2: 'soon' is no time"),
        ("few poses", "1 poses for 2 clouds"),
        ("odd poses", "poses.txt:1: 3 numbers, neither"),
        ("no quaternion", "poses.txt:1: qx qy qz qw is not a unit quaternion"),
        ("other labels", "labels for none of the clouds"),
        ("binary text", "poses.txt: is not text in UTF-8"),
    ],
)
def test_folders_that_cannot_be_right(what: str, complaint: str, tmp_path: Path) -> None:
    folder = tmp_path / "f"
    broken(folder, what)
    with pytest.raises(UsageError) as caught:
        imported(folder, tmp_path / "d")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["f"]


def change(folder: Path, what: str) -> None:
    """The second of three clouds, poses or boxes is wrong."""
    folder_of(folder, "0.pcd", "1.pcd", "2.pcd")
    points = some_points(1)
    if what == "truncated":
        (folder / "1.pcd").write_bytes(pcd(points)[:-5])
    elif what == "millimetres":
        for axis in "xyz":
            points[axis] *= 1000
        (folder / "1.pcd").write_bytes(pcd(points))
    elif what == "nan":
        points["x"] = np.nan
        (folder / "1.pcd").write_bytes(pcd(points))
    elif what == "no points":
        (folder / "1.pcd").write_bytes(pcd(points[:0]))
    elif what == "jump":
        rows = (f"1 0 0 {x} 0 1 0 0 0 0 1 0" for x in (0, 500, 1000))
        (folder / "poses.txt").write_text("\n".join(rows))
    elif what == "scaled pose":
        (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n2 0 0 0 0 2 0 0 0 0 2 0\n" * 2)
        (folder / "3.pcd").write_bytes(pcd(points))
    elif what == "back in time":
        (folder / "times.txt").write_text("0.1\n0.3\n0.2\n")
    elif what == "unreadable":
        (folder / "1.pcd").unlink()
        os.symlink(folder, folder / "1.pcd")
        (folder / "1.pcd").unlink()
        (folder / "1.pcd").write_bytes(pcd(points))
        (folder / "labels").mkdir()
        (folder / "labels" / "1.txt").mkdir()
        (folder / "labels" / "0.txt").touch()
    elif what in ("class", "size", "words"):
        (folder / "labels").mkdir()
        line = {"class": "1 2 3 4 5 6 0 Ufo", "size": "1 2 3 4 0 6 0 Car", "words": "1 2 3 Car"}[what]
        (folder / "labels" / "1.txt").write_text(f"{line}\n")


@pytest.mark.parametrize(
    ("what", "complaint"),
    [
        ("truncated", "1.pcd: it is truncated"),
        ("millimetres", "1.pcd: the points of ego/lidar lie"),
        ("nan", "1.pcd: the cloud of ego/lidar has no finite point"),
        ("no points", "1.pcd: the cloud of ego/lidar has no points"),
        ("jump", "1.pcd: the pose of ego jumps 500.0 m"),
        ("scaled pose", "1.pcd: its pose is not a rotation"),
        ("back in time", "2.pcd: its time 200000000 ns is not after that of"),
        ("unreadable", "1.txt: cannot be read: Is a directory"),
        ("class", "labels/1.txt: the class 'Ufo' is unknown; say what it is with --class"),
        ("size", "1.pcd: a box has the size 0 m"),
        ("words", "labels/1.txt:1: 4 words, not x y z dx dy dz heading class"),
    ],
)
def test_what_is_wrong_in_a_frame_is_said_in_one_line(what: str, complaint: str, tmp_path: Path) -> None:
    folder = tmp_path / "f"
    change(folder, what)
    with pytest.raises(AdvpipeError) as caught:
        imported(folder, tmp_path / "d")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["f"]


def test_names_that_are_not_utf8(tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"t\xff")
    folder_of(folder, os.fsdecode(b"\xfe1.pcd"))
    summary = imported(folder, tmp_path / "d")
    assert BagReader(summary.bag).provenance["scenario_name"] == "t\\udcff"
    (folder / os.fsdecode(b"\xfe1.pcd")).write_bytes(b"")
    with pytest.raises(AdvpipeError, match="no line DATA"):
        imported(folder, tmp_path / "e")


def test_clouds_without_labels_and_labels_without_clouds_are_told(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "f", "0.pcd", "1.pcd")
    (folder / "labels").mkdir()
    (folder / "labels" / "0.txt").touch()
    (folder / "labels" / "9.txt").touch()
    notes = " ".join(opened(folder).notes)
    assert "Files in labels/ without a cloud: 1, such as 9.txt." in notes
    assert "Clouds without labels: 1 of 2" in notes
    frames = list(opened(folder).frames())
    assert [frame.vehicles["ego"].boxes is None for frame in frames] == [False, True]


@pytest.mark.parametrize(
    "options", [{"interval_s": 0.0}, {"interval_s": float("nan")}, {"columns": "x,y,z"}, {"points": "/a"}]
)
def test_options_that_make_no_sense(options: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        imported(folder_of(tmp_path / "f", "0.pcd"), tmp_path / "d", **options)
