"""Attacks on fixes and messages in a grid: one cell each, scored by what vehicles believe."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from grids import write_grid_file

import advpipe
from advpipe.pipeline.campaigns.grid.cell import (
    GridCell,
    GridOrigin,
    GridValues,
    ScoredCell,
    StoredGridCell,
)
from advpipe.pipeline.campaigns.grid.document import write_grid
from advpipe.pipeline.campaigns.grid.load import LoadedGrid, load_grid
from advpipe.pipeline.campaigns.grid.message_tables import message_tables
from advpipe.pipeline.campaigns.grid.run import Grid
from advpipe.pipeline.campaigns.grid.statistics import DriveMean, groups_of_cells
from advpipe.pipeline.campaigns.grid.store import GridStore

ATTACKS = {
    "bias": {"type": "gnss-bias", "parameters": {"bound_m": 8.0}},
    "offset": {
        "type": "cam-position-offset",
        "attackers": {"share": 0.5},
        "parameters": {"x_m": 30.0, "y_m": 0.0},
    },
}
COARSE = {
    "simulation.duration_s": 3,
    "traffic.vehicles": 20,
    "sensors.lidars": {"lidar": {"channels": 4, "points_per_second": 4000}},
}


@pytest.mark.nightly
def test_fixes_and_messages_are_scored_without_a_detector(tmp_path: Path) -> None:
    file = write_grid_file(
        tmp_path, settings=COARSE, attacks=ATTACKS, defences=["none", "jitter:0.02"], detectors=["small"]
    )
    report = advpipe.grid(file, out=tmp_path / "out", workers=1)
    rows = pq.read_table(report.table).to_pylist()
    assert [(row["attack"], row["stratum"], row["detector"], row["defence"]) for row in rows] == [
        ("bias", "localisation of ego", "", "none"),
        ("bias", "V2X of ego", "", "none"),  # its own CAMs are false, too
        ("offset", "V2X of ego", "", "none"),
    ]
    assert len(list((tmp_path / "out" / "cells").iterdir())) == 2
    bias, _, offset = rows
    assert bias["position_rmse_adv_m"] > bias["position_rmse_clean_m"]
    assert bias["false_messages"] is None
    assert offset["false_messages"] > 0
    assert 0 <= offset["misbehaviour_recall"] <= 1
    assert offset["ldm_error_adv_m"] > offset["ldm_error_clean_m"]
    assert all(row["map_clean"] is None for row in rows)
    page = report.page.read_text(encoding="utf-8")
    assert "Position estimates over drives" in page
    assert "V2X over drives" in page
    assert "mAP ratio over drives" not in page
    report.show()


def cells_of(loaded: LoadedGrid, rmse_m: Mapping[int, float]) -> Iterator[ScoredCell]:
    """A cell of each drive; rmse_m: under attack, by seed."""
    origin = GridOrigin(
        advpipe="0.1",
        code_sha256="c" * 64,
        commit=None,
        clean_sha256="a" * 64,
        bag_sha256="b" * 64,
        detector_sha256="",
        attacked_against=None,
        is_white_box=None,
    )
    for drive in loaded.drives:
        values = GridValues(
            stratum="localisation of ego",
            objects=0,
            frames=0,
            map_clean=None,
            map_adv=None,
            position_rmse_clean_m=1.0,
            position_rmse_adv_m=rmse_m[drive.seed],
        )
        yield ScoredCell(
            GridCell(drive, "bias", "", "none"), StoredGridCell(identity={}, origin=origin, values=(values,))
        )


def test_one_cell_a_drive_and_a_table_over_drives(tmp_path: Path) -> None:
    file = write_grid_file(
        tmp_path, attacks={"bias": ATTACKS["bias"]}, seeds=[1, 2], defences=["none", "jitter:0.02"]
    )
    loaded = load_grid(file)
    grid = Grid(loaded, GridStore(tmp_path), {"small": "d" * 64}, "cpu", 1, keep_bags=False, overwrite=False)
    (cell,) = grid.cells(loaded.drives[0])
    assert (cell.detector, cell.defence) == ("", "none")
    assert cell.identity(loaded.file, grid.sha256_of, "cpu")["detector_sha256"] == ""
    scored = tuple(cells_of(loaded, {1: 3.0, 2: 6.0}))
    (table,) = message_tables(loaded.file, groups_of_cells(scored))
    assert table.title == "Position estimates over drives"
    assert table.lines == (("bias", "ego", "2", "1.0", "4.5", "–", "–"),)
    (tmp_path / "page").mkdir()
    write_grid(tmp_path / "page", loaded.file, scored)
    page = (tmp_path / "page" / "report.html").read_text(encoding="utf-8")
    assert "Position estimates over drives" in page
    assert "mAP ratio over drives" not in page


def test_means_over_drives() -> None:
    assert np.isnan(DriveMean.of(np.array([])).value)
    assert DriveMean.of(np.array([1.0, 3.0])) == DriveMean(2.0, None, 2)
    mean = DriveMean.of(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    assert (mean.value, mean.drives) == (3.0, 5)
    assert mean.ci95 is not None
    low, high = mean.ci95
    assert 1 <= low < 2 < 4 < high <= 5
    assert high - 3 == pytest.approx(3 - low, abs=0.2)
