"""The matrix of transfer: its rows, its means, and what an ensemble brings on the detector left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmark_modules import benchmark_module

from advpipe.pipeline.campaigns.sweep.budgets import budget_named

NAMES = ("a@1", "b@2", "c@3")
LEFT = {
    ("best", ("a@1",)): (5.0, 60.0, 70.0),
    ("best", ("b@2",)): (80.0, 6.0, 40.0),
    ("best", ("c@3",)): (50.0, 90.0, 7.0),
    ("ensemble", ("b@2", "c@3")): (45.0, 8.0, 9.0),
    ("ensemble", ("a@1", "c@3")): (8.0, 70.0, 9.0),
    ("ensemble", ("a@1", "b@2")): (8.0, 9.0, 30.0),
}
"""What each attack leaves of a, b and c; `random-best` leaves about 90."""


@pytest.fixture(scope="module")
def transfer() -> Iterator[ModuleType]:
    with benchmark_module("transfer") as module:
        yield module


@pytest.fixture
def matrix(transfer: ModuleType) -> Any:
    """With figures instead of attacked clouds, in two draws of frames as well."""

    class FixedMatrix(transfer.Matrix):  # type: ignore[name-defined, misc]
        def cells(self, row: Any) -> dict[str, dict[str, Any]]:
            values = LEFT.get((row.recipe, row.attacked), (90.0, 91.0, 92.0))
            return {
                name: {kind: np.array([v, v - 1, v + 1]) for kind in ("strict", "loose")}
                for name, v in zip(NAMES, values, strict=True)
            }

    return FixedMatrix(budget_named("detach-1"), SimpleNamespace(evaluated=dict.fromkeys(NAMES)))


def table(lines: Iterable[str]) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_an_ensemble_is_of_all_detectors_but_one(transfer: ModuleType) -> None:
    row = transfer.Row
    assert transfer.rows_of(["best", "ensemble"], NAMES) == [
        *(row("best", (name,)) for name in NAMES),
        row("ensemble", ("b@2", "c@3")),
        row("ensemble", ("a@1", "c@3")),
        row("ensemble", ("a@1", "b@2")),
    ]
    assert (row("ensemble", ()).plain_recipe, row("ensemble-transfer", ()).plain_recipe) == (
        *("best", "transfer"),
    )


def test_the_matrix_has_random_rows_beside(transfer: ModuleType, matrix: Any) -> None:
    _, _, first, *_, last = rows = table(matrix.lines(transfer.rows_of(["best"], NAMES)))
    assert [row[0] for row in rows[2:]] == ["best"] * 3 + ["random-best"] * 3
    assert first[1:3] == ["a", "5.0* (−85.0 (−85.0…−85.0))"]
    assert last == ["random-best", "c", "90.0", "90.0", "91.0", "91.0", "92.0*", "92.0*"]


def test_the_mean_leaves_out_what_was_attacked(matrix: Any) -> None:
    assert matrix.unseen("best", "strict")[0] == np.mean([60, 70, 80, 40, 50, 90])
    assert matrix.unseen("ensemble", "strict")[0] == pytest.approx(np.mean([45, 70, 30]))


def test_an_ensemble_is_compared_with_its_better_member(matrix: Any) -> None:
    """On a, c alone leaves 50; on b, a alone 60; on c, b alone 40."""
    rows = table(matrix.lines_of_ensembles("ensemble"))[2:]
    assert [row[:4] for row in rows] == [
        ["b + c", "a", "45.0", "50.0"],
        ["a + c", "b", "70.0", "60.0"],
        ["a + b", "c", "30.0", "40.0"],
    ]
    assert rows[1][4] == "+10.0 (+10.0…+10.0)"
