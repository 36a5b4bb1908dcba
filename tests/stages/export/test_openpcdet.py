"""OpenPCDet's custom form from bags: every digit comes back."""

from pathlib import Path

import numpy as np
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import import_drive
from tests.stages.import_.kitti.kitti_folders import write_object_frames

SAMPLE = Path(__file__).parents[3] / "sample"


def test_a_simulated_drive_comes_back(tmp_path):
    summary = export_bags(SAMPLE / "clean", "openpcdet", tmp_path / "out")
    request = ImportRequest("openpcdet", tmp_path / "out" / "clean", ImportOptions(interval_s=0.1))
    back = import_drive(request, tmp_path / "back").bag
    objects = 0
    for before, after in zip(read_frames(SAMPLE / "clean"), read_frames(back), strict=True):
        for name in ("x", "y", "z", "intensity"):
            assert before.cloud[name].tobytes() == after.cloud[name].tobytes()
        assert after.boxes.labels.tolist() == before.boxes.labels.tolist()
        assert np.array_equal(after.boxes.geometry[:, :6], before.boxes.geometry[:, :6])
        # A yaw passes through a quaternion, and may differ by a rounding.
        assert np.allclose(np.exp(1j * after.boxes.geometry[:, 6]), np.exp(1j * before.boxes.geometry[:, 6]))
        objects += len(before.boxes)
    assert summary.objects == objects > 0


def test_ignored_objects_keep_their_class(tmp_path):
    root = write_object_frames(tmp_path / "kitti")
    data_set = import_drive(ImportRequest("kitti", root, ImportOptions()), tmp_path / "d").data_set
    summary = export_bags(data_set, "openpcdet", tmp_path / "out")
    lines = (tmp_path / "out" / "clean" / "labels" / "000003.txt").read_text().splitlines()
    assert [line.split()[-1] for line in lines] == ["Car", "Van"]
    assert (tmp_path / "out" / "clean" / "ImageSets" / "val.txt").read_text() == "000007\n"
    assert "under which licence" in summary.notes[-1]
    assert yaml.safe_load((tmp_path / "out" / "source.yaml").read_text())["licence"] == "CC-BY-NC-SA-3.0"


def test_the_configuration_fits_the_voxels_of_second(tmp_path):
    export_bags(SAMPLE / "clean", "openpcdet", tmp_path / "out")
    data = yaml.safe_load((tmp_path / "out" / "openpcdet" / "second.yaml").read_text())["DATA_CONFIG"]
    low, high = np.reshape(data["POINT_CLOUD_RANGE"], (2, 3))
    cells = (high - low) / data["DATA_PROCESSOR"][2]["VOXEL_SIZE"]
    # As OpenPCDet's tutorial asks: 40 cells high, a multiple of 16 along and across.
    assert np.allclose(cells % [16, 16, 40], 0) or np.allclose(cells, np.round(cells))
    assert round(cells[2]) == 40
    assert data["DATA_PATH"] == "../data/advpipe/clean"
    compile((tmp_path / "out" / "openpcdet" / "create_infos.py").read_text(), "create_infos.py", "exec")
