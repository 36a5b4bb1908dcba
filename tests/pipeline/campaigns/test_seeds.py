"""Drives of several seeds: what is typed, the same bytes as one by one, and what is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.seeds import parse_seeds, simulate_seeds
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate


def test_lists_of_seeds() -> None:
    assert parse_seeds("3") == (3,)
    assert parse_seeds("1-3,7, 2") == (1, 2, 3, 7)
    for text in ("", "a", "3-1", "1,,2", "-1", "1.5", "1-", "\u0661"):
        with pytest.raises(UsageError, match=r"write numbers and ranges, such as 1-20,25$"):
            parse_seeds(text)
    for text in ("0-10000", "1-6000,10001-20000", "0-999999999999999999"):
        with pytest.raises(UsageError, match=r"more than 10000 drives; give fewer$"):
            parse_seeds(text)


def test_a_drive_of_a_seed_is_that_of_simulate_and_is_kept(tmp_path: Path) -> None:
    scenario = load_scenario("smoke", {"simulation.duration_s": 0.1, "simulation.warmup_s": 0})
    second = scenario.model_copy(update={"simulation": scenario.simulation.model_copy(update={"seed": 2})})
    simulate(second, tmp_path / "few-seed2")
    kept, made = simulate_seeds(scenario, [2, 5], tmp_path / "few", workers=1)
    assert (kept.folder, kept.summary) == (tmp_path / "few-seed2", None)
    assert made.summary is not None
    assert made.summary.bag == tmp_path / "few-seed5" / "clean"
    assert BagReader(made.summary.bag).provenance["seed"] == "5"


def test_a_folder_that_is_no_drive_is_refused(tmp_path: Path) -> None:
    scenario = load_scenario("smoke", {"simulation.duration_s": 0.1})
    (tmp_path / "few-seed3").mkdir()
    with pytest.raises(UsageError, match=r"few-seed3 exists and holds no drive; remove it"):
        simulate_seeds(scenario, [1, 3], tmp_path / "few")
    assert not (tmp_path / "few-seed1").exists()
