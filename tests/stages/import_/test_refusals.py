"""What an import refuses or tells before and beside its frames: classes, folders, sparse clouds, heights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import use_flags
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.sparse import CloudSize, sparse_clouds
from tests.stages.import_.av2.tiny_av2 import write_av2
from tests.stages.import_.importing import import_form
from tests.stages.import_.kitti.kitti_folders import (
    points,
    write_object_frames,
    write_odometry,
    write_raw_drive,
)
from tests.stages.import_.nuscenes.tiny_nuscenes import write_nuscenes
from tests.stages.import_.opv2v.tiny_opv2v import write_opv2v

SAMPLE = Path(__file__).parents[3] / "sample"


def point_folders(folder: Path) -> Path:
    for part in ("points", "labels"):
        (folder / part).mkdir(parents=True)
    for seed in range(2):
        np.save(folder / "points" / f"{seed:06d}.npy", points(seed))
        (folder / "labels" / f"{seed:06d}.txt").write_text("10 -2 -1 4 1.6 1.5 0 Lorry\n")
    return folder


def write_raw(folder: Path) -> Path:
    write_raw_drive(folder / "2011_09_26")
    return folder


@pytest.mark.parametrize(
    ("form", "write", "options", "typed", "meant"),
    [
        ("kitti", write_object_frames, {}, "Vann", "Van"),
        ("kitti", write_raw, {}, "car", "Car"),
        ("openpcdet", point_folders, {}, "Lory", "Lorry"),
        ("files", point_folders, {}, "Lory", "Lorry"),
        ("nuscenes", write_nuscenes, {"drive": "scene-0061"}, "vehicle.trailers", "vehicle.trailer"),
        ("av2", write_av2, {}, "SIGNS", "SIGN"),
        ("opv2v", write_opv2v, {}, "Truk", "Truck"),
        ("rosbag", lambda folder: SAMPLE / "clean", {}, "cars", "car"),
    ],
)
def test_a_misspelt_class_is_refused_with_what_may_be_meant(form, write, options, typed, meant, tmp_path):
    source = write(tmp_path / "source")
    complaint = f"has no class '{typed}'; did you mean '{meant}'"
    with pytest.raises(UsageError, match=complaint) as error, use_flags():
        import_form(form, source, tmp_path / "d", classes={typed: "truck"}, **options)
    assert f"--class {typed}=truck" in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "d").exists()


def test_a_class_that_only_the_labels_have_can_be_mapped(tmp_path):
    source = point_folders(tmp_path / "source")
    summary = import_form("openpcdet", source, tmp_path / "d", classes={"Lorry": "truck", "Van": "truck"})
    assert summary.counts.objects == 2


@pytest.mark.parametrize("write", [write_object_frames, write_odometry, write_raw])
def test_clouds_of_another_type_are_refused_and_other_files_told(write, tmp_path):
    source = write(tmp_path / "kitti")
    folder = next(source.rglob("*.bin")).parent
    (folder / "notes.md").write_text("mine")
    told = import_form("kitti", source, tmp_path / "d").notes
    assert f"{folder.name} holds what is no .bin file, and is left out: notes.md" in told
    (folder / "x.pcd").write_text("a cloud")
    with pytest.raises(UsageError, match=r"x\.pcd: .* holds 1 \.pcd file, where this form has \.bin alone"):
        import_form("kitti", source, tmp_path / "mixed")


def test_a_cloud_that_was_truncated_between_two_points_is_told(tmp_path):
    root = write_object_frames(tmp_path / "kitti", tuple(f"{index:06d}" for index in range(6)))
    file = root / "training" / "velodyne" / "000002.bin"
    file.write_bytes(file.read_bytes()[: 16 * 100])
    (told,) = (note for note in import_form("kitti", root, tmp_path / "d").notes if "truncated" in note)
    assert told.startswith("1 of 6 clouds of ego/lidar have less than half of the points")
    assert f"{file}: 100 of some 300" in told


def test_clouds_are_compared_with_their_neighbours_of_the_same_lidar():
    def sizes(lidar: str, *points: int) -> list[CloudSize]:
        return [CloudSize(lidar=lidar, frame=str(k), points=n) for k, n in enumerate(points)]

    growing = sizes("ego/lidar", *range(200, 1000, 50))
    assert not list(sparse_clouds(growing + sizes("cav_1/lidar", 10, 11, 12, 9)))
    assert not list(sparse_clouds(sizes("ego/lidar", 1000, 1)))  # two tell nothing
    (told,) = sparse_clouds(growing + sizes("cav_1/lidar", 3, 11, 12, 9))
    assert "1 of 4 clouds of cav_1/lidar" in told


@pytest.mark.parametrize("form", ["kitti", "openpcdet", "nuscenes", "opv2v", "pcd"])
def test_the_top_of_an_export_names_its_folders(form, tmp_path):
    export_bags(SAMPLE / "clean", form, tmp_path / "out")
    importing = "files" if form == "pcd" else form
    with pytest.raises(UsageError, match=r"is an export of advpipe .*; give one of them: clean$"):
        import_form(importing, tmp_path / "out", tmp_path / "d")


@pytest.mark.parametrize("height_m", [0.0, 0.29, 10.1, 173.0, -1.7])
def test_heights_that_no_lidar_has_are_refused(height_m):
    with pytest.raises(UsageError, match=r"lidar_height_m is .* must be 0.3 to 10"):
        ImportOptions(lidar_height_m=height_m)
