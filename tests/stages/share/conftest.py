"""A small data set, made by all stages as a user would, and what sharing makes of it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from advpipe.pipeline.cli.run import run
from advpipe.stages.share.run import ShareOptions, share

SCENARIO = """
name: tiny
description: A pipe | in words
simulation: {seed: 1, duration_s: 1, warmup_s: 1}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 60, pedestrians: 5, parked_per_km: 60}
sensors: {lidars: {lidar: {channels: 16, points_per_second: 72000}}}
attacks:
  fewer_points: {type: detach, recipe: random, parameters: {ratio: 0.1}, frames: "::5"}
  false_speed:
    type: cam-speed-constant
    attackers: {share: 0.5}
"""


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nobody writes into it: take `dataset` for that."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "tiny.yaml").write_text(SCENARIO, encoding="utf-8")
    run(str(folder / "tiny.yaml"), folder / "tiny")
    return folder / "tiny"


@pytest.fixture(scope="session")
def shared(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("shared") / "tiny"
    share(recorded, out, ShareOptions(licence="CC-BY-4.0", citation="A. Author, 2026"))
    return out


@pytest.fixture
def dataset(recorded: Path, tmp_path: Path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(recorded, tmp_path / "own"))
