"""The tables of measured attacks in the README and in docs/ are those of the committed cells."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))

import make_results  # noqa: E402


@pytest.mark.parametrize("page", make_results.PAGES, ids=lambda page: page.name)
def test_tables_are_made_from_the_cells(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(make_results.BLOCK.findall(text)) == text.count("<!-- results: ") > 0
    assert make_results.with_tables(text) == text


@pytest.mark.parametrize("name", ["attacks", "short"])
def test_a_table_has_the_figures_of_a_cell(name: str) -> None:
    cells = make_results.Store(make_results.REPORTS / "town06").cells()
    (cell,) = [cell for cell in cells if cell.name == "best-detach-1"]
    head, *lines = make_results.TABLES[name]([cell])
    (line,) = [dict(zip(head, line, strict=True)) for line in lines if "`best`" in line]
    low, high = cell.attacked.map_ratio_ci95 or (0.0, 0.0)
    assert line["strict, %"] == f"{cell.attacked.map_ratio_percent:.1f} ({low:.1f}…{high:.1f})"
    success = cell.listed["attack_success"]
    (lost,) = [each for each in success if (each["condition"], each["range"]) == ("adv", "all")]
    assert line["lost strictly, %"] == f"{100 * lost['strict_lost'] / lost['strict_found_clean']:.0f}"


def test_robust_is_stronger_than_chance_under_every_defence() -> None:
    """As the page says: at all budgets, by more than the paired interval."""
    cells = make_results.Store(make_results.REPORTS / "town06").cells()
    robust = [cell for cell in cells if cell.recipe == "robust"]
    assert len(robust) == 3
    records = [each for cell in robust for each in cell.listed["defences"]]
    assert len(records) == 3 * 7
    assert all(each["significant_vs_random_best"] for each in records)
    of_best = [each for cell in cells if cell.recipe == "best" for each in cell.listed["defences"]]
    assert [
        each["defence"].partition(":")[0] for each in of_best if not each["significant_vs_random_best"]
    ] == ["quantise", "jitter", "shift"]


def test_what_the_page_says_of_todays_cells() -> None:
    cells = {cell.name: cell for cell in make_results.Store(make_results.REPORTS / "town06-anew").cells()}
    below = "map_loose_ratio_delta_points_vs_random_best_ci95"
    for name in (name for name in cells if name.startswith("robust")):
        records = cells[name].listed["defences"]
        assert all(each["significant_vs_random_best"] for each in records)
        not_below = [each["defence"] for each in records if each[below][1] >= 0]
        assert not_below == (["outliers:k=2,sigmas=1.1"] if "detach" in name else [])
    for name in (name for name in cells if name.startswith("stealthy")):
        for each in cells[name].listed["attack_detection"]:
            assert each["true_positive_percent"] <= each["false_positive_percent"] + 1
    paper, best = cells["paper-detach-1"], cells["best-detach-1"]
    random = paper.row.baselines["random_best"]
    assert (random.map_ratio_delta_points_ci95 or (0, 0))[0] > 0
    assert (random.map_loose_ratio_delta_points_ci95 or (0, 0))[1] < 0
    times = paper.attacked.chamfer_distance_m2 / best.attacked.chamfer_distance_m2
    assert 25 < times < 35
