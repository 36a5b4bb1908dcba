"""One short drive, really simulated and really attacked, of which each test gets a copy to spoil."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

sys.path.insert(0, str(Path(__file__).parent))

Edit = Callable[[Iterable[RawMessage]], Iterable[RawMessage]]

OVERRIDES = (
    *("simulation.duration_s=1", "simulation.warmup_s=5", "traffic.vehicles=20", "traffic.pedestrians=5"),
    *("sensors.lidars.lidar.channels=12", "sensors.lidars.lidar.points_per_second=43200"),
)
ATTACKS = {
    "detach": {"type": "detach", "recipe": "random", "parameters": {"ratio": 0.02}, "frames": "::4"},
    "perturb": {"type": "perturb", "recipe": "random", "parameters": {"eps_cm": 5.0}, "frames": "1:9:3"},
    "attach": {
        "type": "attach",
        "recipe": "random",
        "parameters": {"eps_m": 0.5, "points": 9},
        "frames": ":2",
    },
    "cam": {"type": "cam-position-offset", "attackers": {"share": 0.3}},
    "delay": {"type": "cam-delay", "attackers": {"share": 0.3}},
    "dos": {"type": "cam-dos", "attackers": {"share": 0.1}, "dcc_reacts": True},
    "gnss": {"type": "gnss-bias", "victim": "ego"},
}


@pytest.fixture(scope="session")
def _drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("verify") / "drive"
    simulate(load_scenario("boulevard", OVERRIDES), path)
    for name, options in ATTACKS.items():
        attack(path / "clean", path / name, AttackRequest((attack_spec(options),)), workers=1)
    return path


@pytest.fixture
def data_set(_drive: Path, tmp_path: Path) -> Path:
    """A clean drive of 1 s and an adversarial bag for each of `ATTACKS`; without SHA256SUMS."""
    return Path(shutil.copytree(_drive, tmp_path / "drive"))


@pytest.fixture
def shared(data_set: Path) -> Path:
    """The same with checksums; without most attacks, so that it is small."""
    for name in ATTACKS.keys() - {"detach", "gnss"}:
        shutil.rmtree(data_set / name)
    checksums.write(data_set)
    return data_set


@pytest.fixture
def rewrite() -> Callable[[Path, Edit], None]:
    def rewrite(bag: Path, edit: Edit) -> None:
        """The bag with other messages, whole in itself: only what they say can tell."""
        reader = BagReader(bag)
        beside = [path for path in bag.iterdir() if path.suffix != ".mcap" and path.name != METADATA_NAME]
        with BagWriter(bag, provenance=reader.provenance, overwrite=True) as writer:
            for path in beside:
                shutil.copy(path, writer.folder)
            for raw in edit(reader.raw_messages()):
                writer.copy(raw)

    return rewrite
