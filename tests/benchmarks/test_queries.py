"""Black-box attacks over their queries: equal numbers of tries, and differences to random ones."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from benchmark_modules import benchmark_module

from advpipe.pipeline.adversary.constraints import BLACK_BOX
from advpipe.pipeline.campaigns.sweep.budgets import budget_named

LEFT = {"random-best": 60.0, "score-based": 45.0, "decision-based": 62.0}


@pytest.fixture(scope="module")
def queries() -> Iterator[ModuleType]:
    with benchmark_module("queries") as module:
        yield module


class FixedClouds:
    """Has figures instead of attacked clouds, in two draws of frames as well, and notes the attacks."""

    def __init__(self) -> None:
        self.evaluated = {"small@1": None}
        self.attacks: dict[str, Any] = {}

    def ratios(self, name: str, attack: Any, victim: Any) -> dict[str, dict[str, Any]]:
        self.attacks[name] = attack
        left = LEFT[attack.recipe] - 0.1 * attack.query_budget
        values = np.array([left, left - 1, left - 3])
        return {"small@1": {"strict": values, "loose": values + 20}}


@pytest.mark.parametrize("budget", ["perturb-10", "detach-1", "attach-0.5"])
def test_all_recipes_judge_as_many_clouds(queries: ModuleType, budget: str) -> None:
    clouds = FixedClouds()
    queries.report(budget_named(budget), clouds, [25, 100])
    assert {(one.recipe, one.query_budget) for one in clouds.attacks.values()} == {
        (recipe, count) for recipe in LEFT for count in (25, 100)
    }
    assert set(LEFT) == {queries.TO_BEAT, *BLACK_BOX}


def test_differences_are_to_random_tries_of_the_same_number(
    queries: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    strict = queries.report(budget_named("detach-1"), FixedClouds(), [50, 100])
    assert strict == {"random-best": [55, 50], "score-based": [40, 35], "decision-based": [57, 52]}
    lines = capsys.readouterr().out.splitlines()
    (row,) = [line for line in lines if line.startswith("| score-based | strict")]
    assert row == "| score-based | strict | 40.0 (−15.0 (−15.0…−15.0)) | 35.0 (−15.0 (−15.0…−15.0)) |"
    (row,) = [line for line in lines if line.startswith("| random-best | loose")]
    assert row == "| random-best | loose | 75.0 | 70.0 |"


def test_too_few_queries_are_refused(
    queries: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["queries.py", "bag", "--out", "out", "--queries", "1"])
    with pytest.raises(SystemExit) as ended:
        queries.main()
    assert ended.value.code == 2
    assert f"give {queries.LEAST_QUERIES} or more" in capsys.readouterr().err
