"""Two frames of KITTI itself: ADVPIPE_REAL names the folder that holds `kitti/training`."""

import os
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.export.run import export_bags
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.run import ImportSummary, import_drive

pytestmark = pytest.mark.oracle


@pytest.fixture(scope="module")
def source() -> Path:
    if not (name := os.environ.get("ADVPIPE_REAL")):
        pytest.skip("ADVPIPE_REAL is not set")
    return Path(name) / "kitti"


@pytest.fixture(scope="module")
def summary(source: Path, tmp_path_factory: pytest.TempPathFactory) -> ImportSummary:
    out = tmp_path_factory.mktemp("real") / "d"
    return import_drive(ImportRequest("kitti", source, ImportOptions()), out)


def test_points_lie_on_the_objects(summary):
    """Boxes in the wrong place, or turned, hold few points: KITTI labels what its LiDAR has met."""
    for frame in read_frames(summary.bag):
        inside = count_points(xyz(frame.cloud), frame.boxes.geometry)
        turned = frame.boxes.geometry.copy()
        turned[:, 6] += np.pi / 2
        assert (inside >= 5).mean() > 0.9
        assert inside.sum() > 1.2 * count_points(xyz(frame.cloud), turned).sum()
        assert len(frame.boxes) >= 6


def test_clouds_and_labels_come_back_as_they_are(source, summary, tmp_path):
    export_bags(summary.data_set, "kitti", tmp_path / "out")
    training = source / "training"
    for cloud in sorted((training / "velodyne").glob("*.bin")):
        ours = tmp_path / "out" / "clean" / "training"
        assert (ours / "velodyne" / cloud.name).read_bytes() == cloud.read_bytes()
        label = training / "label_2" / f"{cloud.stem}.txt"
        assert (ours / "label_2" / label.name).read_text() == label.read_text()
