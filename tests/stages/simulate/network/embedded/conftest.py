"""Short drives with V2X, recorded once for all tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")

Record = Callable[..., BagReader]


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Records the scenario `smoke` with other settings and next to no LiDAR, each once only."""

    @cache
    def record(*settings: str) -> BagReader:
        out: Path = tmp_path_factory.mktemp("v2x") / "drive"
        simulate(load_scenario("smoke", [*COARSE, *settings]), out)
        return BagReader(out / "clean")

    return record
