"""What a sweep's result is for programs and in a notebook, by the committed sweep of the paper's budgets."""

from __future__ import annotations

import json
from pathlib import Path

from advpipe.pipeline.campaigns.sweep.run import SweepReport
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.campaigns.sweep.tables import recipes_of

FOLDER = Path(__file__).parents[4] / "datasets" / "reports" / "town06-budgets"


def test_rows_are_those_of_its_report() -> None:
    cells = Store(FOLDER).cells()
    report = SweepReport(FOLDER, cells, recipes_of(cells), [])
    rows = report.to_dicts()
    assert len(rows) == len(cells)
    listed = json.loads((FOLDER / "report.json").read_text(encoding="utf-8"))["cells"]
    done = {(each["recipe"], each["cell"]): each for each in listed if each["status"] == "done"}
    assert {(row["recipe"], row["cell"]) for row in rows} == set(done)
    for row in rows:
        stored = done[row["recipe"], row["cell"]]
        assert row["paper_map_ratio_percent"] == stored["paper_map_ratio_percent"]
        assert row["map_ratio_percent"] == stored["row"]["map_ratio_percent"]
    assert report.to_pandas()["map_ratio_percent"].notna().all()


def test_it_shows_the_papers_tables() -> None:
    cells = Store(FOLDER).cells()[:3]
    report = SweepReport(FOLDER, cells, recipes_of(cells), [])
    assert repr(report) == f"<SweepReport {FOLDER}: {', '.join(cell.name for cell in cells)}>"
    html = report._repr_html_()
    assert "<caption>Table I</caption>" in html
    assert html.count("<caption>Table II") == 3
