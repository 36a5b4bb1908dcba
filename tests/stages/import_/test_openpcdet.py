"""OpenPCDet's custom form: points and boxes in the LiDAR's frame, as they are."""

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from tests.stages.import_.kitti.kitti_folders import points, write_text

LABELS = """\
10.1234567890123 -2 -0.95 4 1.6 1.5 -0.3 Vehicle
20 3 -1 0.8 0.6 1.7 4.0 Pedestrian
5 9 -1 9 3 3 0 Tram
"""


@pytest.fixture
def source(tmp_path):
    for seed, name in enumerate(("a1", "a2")):
        write_text(tmp_path / "s" / "labels" / f"{name}.txt", LABELS)
        (tmp_path / "s" / "points").mkdir(exist_ok=True)
        np.save(tmp_path / "s" / "points" / f"{name}.npy", points(seed))
    return tmp_path / "s"


def imported(source, out, **options):
    return import_drive(ImportRequest("openpcdet", source, ImportOptions(**options)), out)


def test_clouds_and_boxes_are_those_of_the_files(source, tmp_path):
    summary = imported(source, tmp_path / "d", lidar_height_m=1.8)
    for seed, frame in enumerate(read_frames(summary.bag)):
        cloud = np.stack([frame.cloud[name] for name in ("x", "y", "z", "intensity")], axis=1)
        assert cloud.tobytes() == points(seed).tobytes()
        assert frame.boxes.labels.tolist() == [0, 3]
        assert frame.boxes.geometry[0, :6].tolist() == [10.1234567890123, -2, -0.95, 4, 1.6, 1.5]
        assert np.allclose(frame.boxes.geometry[:, 6], [-0.3, 4.0 - 2 * np.pi])
        assert frame.boxes.ids == (f"a{seed + 1}/0", f"a{seed + 1}/1")
        assert frame.uncounted.boxes.class_names == ("Tram",)


def test_columns_and_intensities_are_named(source, tmp_path):
    for seed, name in enumerate(("a1", "a2")):
        table = points(seed)
        table[:, 3] *= 255
        np.save(source / "points" / f"{name}.npy", np.column_stack([table, np.full(len(table), 7.0)]))
    with pytest.raises(AdvpipeError, match=r"a1\.npy: holds \(300, 5\) of float64, not a table of 4 columns"):
        imported(source, tmp_path / "d")
    bag = imported(source, tmp_path / "d", columns="x,y,z,intensity,ring", scale_intensity=1 / 255).bag
    frame = next(read_frames(bag))
    assert np.allclose(frame.cloud["intensity"], points(0)[:, 3], atol=1e-6)
    assert set(frame.cloud["ring"]) == {7}


def test_a_split_chooses_frames(source, tmp_path):
    write_text(source / "ImageSets" / "val.txt", "a2\n")
    assert next(read_frames(imported(source, tmp_path / "d", split="val").bag)).boxes.ids[0] == "a2/0"


@pytest.mark.parametrize(
    ("file", "content", "problem"),
    [
        ("labels/a2.txt", None, r"labels/a2\.txt is missing; restore it"),
        ("points/a2.npy", None, r"points/a2\.npy is missing; its label has no cloud"),
        ("points/a2.npy", b"\x93NUMPY", r"a2\.npy: is no NumPy array, or is truncated"),
        ("labels/a2.txt", b"1 2 3 4 5 6 Car", "a2.txt: line 1 has 7 values, not 8"),
        ("labels/a2.txt", b"1 2 3 4 5 x 7 Car", "a2.txt: line 1 has a value that is no number"),
        ("labels/a2.txt", b"1 2 3 4 5 nan 7 Car", "a2.txt: line 1 has a value that is not finite"),
        (
            "labels/a2.txt",
            b"1 2 3 4 5 6 7 Ufo",
            "line 1: unknown class 'Ufo'; say what it is: --class Ufo=car",
        ),
        ("labels/a2.txt", b"1 2 3 4 5 -6 7 Car", r"a2\.npy: a box has the size -6 m"),
    ],
)
def test_damaged_folders_fail_with_one_line(source, tmp_path, file, content, problem):
    if content is None:
        (source / file).unlink()
    else:
        (source / file).write_bytes(content)
    with pytest.raises(AdvpipeError, match=problem) as failure:
        imported(source, tmp_path / "d")
    assert "\n" not in str(failure.value)


def test_other_folders_are_refused(tmp_path):
    with pytest.raises(UsageError, match="points is missing; give a folder with points"):
        imported(tmp_path, tmp_path / "d")
    (tmp_path / "points").mkdir()
    with pytest.raises(UsageError, match=r"points holds no \.npy files"):
        imported(tmp_path, tmp_path / "d")
