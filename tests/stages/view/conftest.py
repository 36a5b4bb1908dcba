"""A short drive, really simulated, and what attacks of each family made of it."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from chromium import running_browser

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

SETTINGS = (
    *("simulation.duration_s=2", "simulation.warmup_s=5", "v2x.penetration=1"),
    *("sensors.lidars.lidar.channels=12", "sensors.lidars.lidar.points_per_second=43200"),
)
ATTACKS = {
    "detach": {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.02}, "frames": "0:4"},
    "cam": {"type": "cam-position-offset", "attackers": {"share": 0.5}},
    "gnss": {"type": "gnss-bias", "victim": "ego"},
}


@pytest.fixture(scope="session")
def dataset(tmp_path_factory):
    """A data set with a clean bag and one for each of `ATTACKS`."""
    path = tmp_path_factory.mktemp("view") / "drive"
    simulate(load_scenario("smoke", SETTINGS), path)
    for name, options in ATTACKS.items():
        attack(path / "clean", path / name, AttackRequest((attack_spec(options),)), workers=1)
    return path


@pytest.fixture(scope="module")
def browser():
    with running_browser() as found:
        yield found
