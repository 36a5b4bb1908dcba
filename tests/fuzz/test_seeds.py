"""Regression inputs: each is handled."""

from __future__ import annotations

import pytest

from tests.fuzz import base
from tests.fuzz.findings import Finding, all_of
from tests.fuzz.seeds import SEEDS
from tests.fuzz.watch import Limits, Watch
from tests.fuzz.worker import SEEDS as REPLAY_SEEDS
from tests.fuzz.worker import Folder


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Finding]:
    """All seeds in one process, within the limits of the nightly run; what is not handled, by name."""
    out = tmp_path_factory.mktemp("seeds")
    base.build(out / "base")
    folder = Folder(out / "work" / REPLAY_SEEDS)
    folder.path.mkdir(parents=True)
    progress = Watch(
        REPLAY_SEEDS, engine=REPLAY_SEEDS, seed=0, folder=folder, limits=Limits(), inputs=len(SEEDS)
    ).run()
    assert progress.inputs == len(SEEDS)
    return {finding.target: finding for finding in all_of(folder.findings)}


@pytest.mark.parametrize("name", [seed.name for seed in SEEDS])
def test_every_seed_input_is_handled(name: str, found: dict[str, Finding]) -> None:
    assert name not in found, f"{found[name]}\n{found[name].fault.trace}"


def test_names_are_unique() -> None:
    assert len({seed.name for seed in SEEDS}) == len(SEEDS)
