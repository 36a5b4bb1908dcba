"""Bags of several LiDARs: an export says which clouds it does not write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.option_names import use_flags
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.export.form import ExportOptions
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.point_files import COLUMN_NAMES, cloud_of_columns
from tests.stages.export.drives import SAMPLE, write_bag
from tests.stages.import_.kitti.kitti_folders import points

EGO, ROOF, OTHER = "/ego/lidar/points", "/ego/roof/points", "/cav_1/lidar/points"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Two LiDARs of the ego, one of another vehicle."""
    cloud = cloud_of_columns(points(0), COLUMN_NAMES[:4], 1.0)
    vehicles = {
        name: VehicleFrame(
            dict.fromkeys(lidars, cloud),
            Boxes(),
            boxes_frame=f"{name}/lidar",
            map_SE3_base=np.eye(4),
            transforms=[(f"{name}/base_link", f"{name}/{lidar}", np.eye(4)) for lidar in lidars],
        )
        for name, lidars in {"ego": ("lidar", "roof"), "cav_1": ("lidar",)}.items()
    }
    return write_bag(tmp_path / "b", DriveFrame("a", 1_000_000_000, vehicles))


@pytest.mark.parametrize(
    ("form", "others"),
    [
        ("kitti", f"{OTHER}, {ROOF}"),
        ("openpcdet", f"{OTHER}, {ROOF}"),
        ("pcd", f"{OTHER}, {ROOF}"),
        ("nuscenes", f"{OTHER}, {ROOF}"),
        ("opv2v", ROOF),
    ],
)
def test_clouds_that_are_left_out_are_named(bag: Path, tmp_path: Path, form: str, others: str) -> None:
    with use_flags():
        notes = export_bags(bag, form, tmp_path / "out", ExportOptions()).notes
    first = others.split(",")[0]
    assert f"clouds of {others} are left out; choose another LiDAR by --lidar {first}" in notes


def test_nothing_is_said_of_a_choice_and_of_a_single_lidar(bag: Path, tmp_path: Path) -> None:
    chosen = export_bags(bag, "pcd", tmp_path / "chosen", ExportOptions(lidar_topic=EGO))
    single = export_bags(SAMPLE, "pcd", tmp_path / "single")
    assert not any("are left out" in note for note in (*chosen.notes, *single.notes))
