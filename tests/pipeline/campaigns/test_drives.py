"""Drives of several scenarios and seeds: the same bytes as one by one, and what is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.drives import planned_drives, simulate_drives
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.run import simulate


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario("smoke", {"simulation.duration_s": 0.1, "simulation.warmup_s": 0})


def test_a_drive_of_a_seed_is_that_of_simulate_and_is_kept(scenario: Scenario, tmp_path: Path) -> None:
    second = scenario.model_copy(update={"simulation": scenario.simulation.model_copy(update={"seed": 2})})
    simulate(second, tmp_path / "few-seed2")
    planned = planned_drives([scenario], [2, 5], lambda _: tmp_path / "few")
    kept, made = simulate_drives(planned, workers=1)
    assert (kept.folder, kept.summary) == (tmp_path / "few-seed2", None)
    assert made.summary is not None
    assert made.summary.bag == tmp_path / "few-seed5" / "clean"
    assert BagReader(made.summary.bag).provenance["seed"] == "5"


def test_several_scenarios_under_their_own_seeds_or_under_several(scenario: Scenario, tmp_path: Path) -> None:
    other = scenario.model_copy(update={"name": "other"})
    planned = planned_drives([scenario, other], [1, 7], lambda one: tmp_path / one.name)
    assert [(drive.folder.name, drive.scenario.simulation.seed) for drive in planned] == [
        (f"{name}-seed{seed}", seed) for name in ("smoke", "other") for seed in (1, 7)
    ]
    planned = planned_drives([scenario, other], None, lambda one: tmp_path / one.name)
    assert [drive.folder for drive in planned] == [tmp_path / "smoke", tmp_path / "other"]
    with pytest.raises(
        UsageError, match=r"^several scenarios have the name smoke, and would be one data set"
    ):
        planned_drives([scenario, scenario], None, lambda one: tmp_path / one.name)


def test_a_folder_that_is_no_drive_is_refused(scenario: Scenario, tmp_path: Path) -> None:
    (tmp_path / "few-seed3").mkdir()
    with pytest.raises(UsageError, match=r"few-seed3 exists and holds no drive; remove it"):
        simulate_drives(planned_drives([scenario], [1, 3], lambda _: tmp_path / "few"))
    assert not (tmp_path / "few-seed1").exists()
