"""The example of a user's attack: a cloud worked out by hand, and used by name from its folder."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.build import build_lidar_attack

EXAMPLE = Path(__file__).parents[3] / "examples" / "my_attack.py"
NAME = "my_attack:Dazzle"


@pytest.fixture
def build(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    yield lambda **parameters: build_lidar_attack(AttackSpec(type=NAME, parameters=parameters))
    sys.modules.pop("my_attack", None)


def test_it_is_as_short_as_it_is_said_to_be():
    assert len(EXAMPLE.read_text().splitlines()) <= 40


def test_the_sector_of_the_nearest_object_is_emptied(build, make_cloud, make_boxes, make_detector):
    """A car at (3, 4), of 53.1 degrees, and one farther off; a sector of 20 degrees is 43.1 to 63.1."""
    bearings = np.radians([42.9, 43.4, 53.1, 62.9, 63.3, 180 + 53.1])
    clutter = np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros(6)]) * 5
    of_car = np.column_stack([np.full(5, 3.0), np.full(5, 4.0), np.linspace(0.1, 0.9, 5)])
    of_other = np.column_stack([np.full(5, 8.0), np.full(5, 1.0), np.linspace(0.1, 0.9, 5)])
    cloud = make_cloud(np.concatenate([clutter, of_car, of_other]))
    boxes = make_boxes([8, 1, 0.5, 1, 1, 1, 0], [3, 4, 0.5, 1, 1, 1, 0])
    detector = make_detector(np.ones((10, 10, 10)), boxes.geometry)
    result = build(width_deg=20.0)(cloud, boxes, detector, np.random.default_rng(0))
    assert result.labels.point.tolist() == [1, 2, 3, *range(6, 11)]
    assert result.cloud.tobytes() == np.delete(cloud, result.labels.point).tobytes()
    assert result.loss_after > result.loss_before
    nothing = build(width_deg=20.0)(cloud, make_boxes(), detector, np.random.default_rng(0))
    assert (len(nothing.labels), nothing.note) == (0, "no object to hide")


def test_its_parameters_are_checked(build):
    with pytest.raises(AdvpipeError, match="width_deg is missing"):
        build()
    with pytest.raises(AdvpipeError, match=r"width_deg is 360\.0, but must lie between"):
        build(width_deg=360)


def test_it_is_used_by_name_from_its_folder(clean_bag, tmp_path):
    shutil.copy(EXAMPLE, tmp_path)
    shutil.copy(Path(__file__).parent / "linear_detector.py", tmp_path)
    arguments = ["attack", str(clean_bag), "--type", NAME, "--set", "width_deg=30", "--frames", "0:2"]
    arguments += ["--detector", "linear_detector:Shipped"]
    command = [sys.executable, "-c", "from advpipe.pipeline.cli import app; app()", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    frames = pq.read_table(str(tmp_path / "my_attack-Dazzle-30" / "frames.parquet")).to_pylist()
    assert [row["attack"] for row in frames] == [NAME, NAME]
    assert all(row["points_adversarial"] < row["points_clean"] for row in frames)
