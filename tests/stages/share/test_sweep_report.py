"""A data set with the report of a sweep beside that of an evaluation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.campaigns.sweep.document import to_json
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.campaigns.sweep.tables import recipes_of
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset.reports import read_report
from advpipe.stages.share.effects import effect_tables, report_warnings
from advpipe.stages.share.run import share

COMMITTED = Path(__file__).parents[3] / "datasets" / "reports" / "town06-budgets"


def write_sweep_report(folder: Path, clean_sha256: str) -> Path:
    """The report of the committed cells, as if they had been made from this clean bag."""
    cells = [
        replace(cell, settings=replace(cell.settings, clean_sha256=clean_sha256))
        for cell in Store(COMMITTED).cells()
    ]
    folder.mkdir(parents=True)
    (folder / "report.json").write_text(to_json(cells, recipes_of(cells), "advpipe sweep", ["Training map"]))
    return folder


def test_a_data_set_with_a_sweep_is_shared(dataset: Path, tmp_path: Path) -> None:
    write_sweep_report(dataset / "reports" / "sweep", parent_sha256(dataset / "clean"))
    share(dataset, tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text(encoding="utf-8")
    assert "### Effect on detection (sweep)" in card
    assert "### Effect on detection (small)" in card
    assert "> **Training map**" in card


def test_a_sweep_of_another_drive_is_refused(dataset: Path, tmp_path: Path) -> None:
    write_sweep_report(dataset / "reports" / "sweep", "0" * 64)
    with pytest.raises(AdvpipeError, match="was made from another clean bag than the one in the data set"):
        share(dataset, tmp_path / "out")


def test_the_table_has_a_line_for_each_cell_of_the_sweep(tmp_path: Path) -> None:
    """As many from the committed report, whose keys are older, as from the same cells written today."""
    today = write_sweep_report(tmp_path / "town06-budgets", "0" * 64)
    (before,), (after,) = effect_tables([COMMITTED]), effect_tables([today])
    assert len(after.lines) == len(Store(COMMITTED).cells())
    assert (before.title, before.heads) == (after.title, after.heads)
    assert sorted(before.lines) == sorted(after.lines)
    assert report_warnings([today]) == ["Training map"]
    assert read_report(today / "report.json").bags == {}
