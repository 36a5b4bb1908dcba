"""Short drives with V2X, and one of them under attack, made once for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")


@pytest.fixture(scope="session")
def smoke(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clean bag of a small drive of 4 s."""
    out = tmp_path_factory.mktemp("v2x-evaluated") / "smoke"
    simulate(load_scenario("smoke", [*COARSE, "simulation.duration_s=4", "v2x.penetration=1"]), out)
    return out / "clean"


@pytest.fixture(scope="session")
def offset(smoke: Path) -> Path:
    """The same with constant position offsets of a fifth of the fleet after 2 s."""
    out = smoke.parent / "cam-position-offset"
    spec = AttackSpec(type="cam-position-offset", schedule=Schedule(from_s=2.0))
    attack(smoke, out, AttackRequest((spec,)))
    return out


@pytest.fixture(scope="session")
def boulevard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clean bag of the default drive of 20 s, other traffic than the thresholds were tuned on."""
    out = tmp_path_factory.mktemp("v2x-evaluated") / "boulevard"
    bare = ("traffic.pedestrians=0", "traffic.parked_per_km=0", "environment.buildings=0")
    settings = [*COARSE, *bare, "simulation.duration_s=20", "simulation.seed=5"]
    simulate(load_scenario("boulevard", settings), out)
    return out / "clean"
