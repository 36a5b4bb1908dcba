"""The table of realism: statistics of clouds whose numbers are known."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from benchmark_modules import benchmark_module
from small_drive import cast, record_small_drive

from advpipe.pipeline.core.frame_slice import ALL_FRAMES
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE

LEADER = (18.0, 0.0, -1.05, 4.6, 1.9, 1.6, 0.0)


@pytest.fixture(scope="module")
def realism() -> Iterator[ModuleType]:
    with benchmark_module("realism") as module:
        yield module


def test_residuals_are_the_noise_across_walls_and_ground(realism: ModuleType) -> None:
    rng = np.random.default_rng(1)
    flat = rng.uniform(-6, 6, (40_000, 2))
    ground = np.column_stack([flat, rng.normal(-1.8, 0.005, len(flat))])
    wall = np.column_stack([flat[:, 0], rng.normal(8.25, 0.02, len(flat)), flat[:, 1] / 2 + 2.0])
    both = np.concatenate([ground, wall])
    residuals = (
        realism.plane_residuals(both, realism.LEVEL, 1),
        realism.plane_residuals(both, 0, realism.UPRIGHT),
    )
    assert np.sqrt(np.mean(residuals[0] ** 2)) == pytest.approx(0.005, rel=0.1)
    assert np.sqrt(np.mean(residuals[1] ** 2)) == pytest.approx(0.02, rel=0.1)


def test_a_cloud_over_a_plane_with_a_car(realism: ModuleType) -> None:
    cloud = cast(leader_ahead_m=18.0)
    cloud["intensity"][::4] = 0.0
    inside = (np.abs(cloud["x"] - 18.0) <= 2.3) & (np.abs(cloud["y"]) <= 0.95)
    rows = {}
    for hidden in (0.0, 0.6):
        statistics = realism.CloudStatistics()
        car = Boxes(np.array([LEADER]), np.zeros(1, np.int64), ("leader",), np.zeros((1, 3)))
        statistics.add(cloud, car, {"leader": hidden})
        rows[hidden] = statistics.rows()
    assert rows[0.0]["points a cloud"] == len(cloud)
    assert rows[0.0]["intensity exactly 0, share"] == pytest.approx(0.25, abs=0.001)
    assert rows[0.0]["cars' length, mean [m]"] == pytest.approx(4.6)
    assert rows[0.0]["ground share"] == pytest.approx(np.mean(cloud["z"] < -1.68), abs=1e-6)
    assert rows[0.0]["points on a visible car at 20 m"] == inside.sum()
    assert np.isnan(rows[0.0]["points on a visible car at 30 m"])
    assert np.isnan(rows[0.6]["points on a visible car at 20 m"])


def test_a_bag_without_boxes_shows_dashes(
    realism: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = record_small_drive(tmp_path / "drive", steps=3)
    rows = realism.measure(bag, ALL_FRAMES)
    assert rows["points a cloud"] == len(cast())
    assert rows["returns per ring, lowest"] == 360
    monkeypatch.setattr(sys, "argv", ["realism.py", str(bag), str(bag)])
    assert realism.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert next(line for line in lines if line.startswith("| intensity on cars")).count("–") == 2


def test_what_is_no_bag_ends_in_one_line(
    realism: ModuleType, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["realism.py", "/nowhere"])
    assert realism.main() == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_an_empty_cloud_counts_nothing(realism: ModuleType) -> None:
    statistics = realism.CloudStatistics()
    statistics.add(np.zeros(0, POINT_DTYPE), Boxes(), {})
    assert all(np.isnan(value) for value in statistics.rows().values())
