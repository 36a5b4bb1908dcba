"""Renamed report keys: the old ones are written beside the new, and read where there is no new one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.results.deprecated import new_key, old_key, with_deprecated_keys, with_new_keys

COMMITTED = Path(__file__).parents[3] / "datasets" / "reports"
NEW = {
    "warnings": ["read this"],
    "rows": [
        {
            "query_budget": 24,
            "significant_vs_random": True,
            "map_ratio_delta_points_vs_baseline_near_ci95": [1, 2],
        }
    ],
    "v2x": [{"false_messages": 3, "ldm_false_entries_max": 2.0, "attacks": [{"false_messages": 1}]}],
    "coordinated": [{"attacked_fixes": 4}],
    "provenance": {"compared": [{"provenance": {"condition": "a user's own"}}]},
}
OLD = {
    "banners": ["read this"],
    "rows": [{"looks": 24, "beats_random": True, "map_ratio_minus_baseline_near_ci95": [1, 2]}],
    "v2x": [{"lies": 3, "ldm_ghosts_max": 2.0, "attacks": [{"lies": 1}]}],
    "coordinated": [{"struck_fixes": 4}],
    "provenance": NEW["provenance"],
}


def test_old_keys_stand_beside_the_new_ones_with_equal_values() -> None:
    written = with_deprecated_keys(NEW)
    listed = written.pop("deprecated_keys")
    assert listed == {
        "banners": "warnings",
        "looks": "query_budget",
        "beats_random": "significant_vs_random",
        "map_ratio_minus_baseline_near_ci95": "map_ratio_delta_points_vs_baseline_near_ci95",
        "lies": "false_messages",
        "ldm_ghosts_max": "ldm_false_entries_max",
        "struck_fixes": "attacked_fixes",
    }
    assert all((new_key(old), old_key(new)) == (new, old) for old, new in listed.items())
    assert written["rows"][0] == {**NEW["rows"][0], **OLD["rows"][0]}
    assert written["v2x"][0]["attacks"] == [{"false_messages": 1, "lies": 1}]
    assert written["provenance"] == NEW["provenance"]
    assert written["banners"] == written["warnings"]


def test_a_report_with_old_keys_alone_is_read_with_one_notice(capsys: pytest.CaptureFixture[str]) -> None:
    assert with_new_keys(OLD, "an/earlier/report.json") == NEW
    assert with_new_keys(OLD, "an/earlier/report.json") == NEW
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("an/earlier/report.json: deprecated report keys")


def test_a_report_with_both_is_read_without_a_notice(capsys: pytest.CaptureFixture[str]) -> None:
    read = with_new_keys(with_deprecated_keys(NEW), "a/new/report.json")
    assert {key: read[key] for key in NEW}["rows"][0].items() >= NEW["rows"][0].items()
    assert capsys.readouterr().err == ""


def test_the_committed_cells_are_read_with_one_notice(capsys: pytest.CaptureFixture[str]) -> None:
    """They were stored before the keys were renamed; their values are those of the report beside them."""
    folder = COMMITTED / "town06-budgets"
    cells = {(cell.recipe, cell.budget): cell for cell in Store(folder).cells()}
    assert len(capsys.readouterr().err.splitlines()) <= 1
    listed = json.loads((folder / "report.json").read_text(encoding="utf-8"))["cells"]
    rows = {(each["recipe"], each["cell"]): each["row"] for each in listed if each["status"] == "done"}
    assert cells.keys() == rows.keys()
    for place, cell in cells.items():
        row = rows[place]
        assert cell.row.attack.query_budget == row["looks"]
        assert cell.row.significant_vs_random is row["beats_random"]
        for name, baseline in cell.row.baselines.items():
            assert baseline.map_ratio_delta_points == row[f"map_ratio_minus_{name}"]
            assert baseline.is_significant is row[f"beats_{name}"]
