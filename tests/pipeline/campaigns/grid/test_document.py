"""The Parquet file and the page of a grid."""

from __future__ import annotations

import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from grids import finished, write_grid_file

from advpipe.pipeline.campaigns.grid.document import print_grid, write_grid


def test_the_table_is_tidy_and_the_page_names_seeds_and_commits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    factors = {
        "traffic.vehicles": [10, 20],
        "weather": {"clear": {}, "fog": {"environment.weather": {"kind": "fog", "visibility_m": 50}}},
    }
    path = write_grid_file(tmp_path, factors=factors, seeds=[7, 8], defences=["none", "jitter:0.02"])
    loaded, cells = finished(path, tmp_path)
    write_grid(tmp_path, loaded.file, cells, ["Training map unknown"])
    table = pq.read_table(tmp_path / "grid.parquet").to_pylist()
    assert len(table) == 2 * 2 * 2 * (2 + 1)  # two strata without a defence, one with
    first = table[0]
    assert (first["traffic.vehicles"], first["weather"], first["seed"]) == (10.0, "clear", 7)
    assert (first["attack"], first["detector"], first["defence"]) == ("detach", "small", "none")
    assert (first["stratum"], first["map_clean"], first["commit"]) == ("all", 0.8, "f" * 40)
    page = (tmp_path / "report.html").read_text()
    for text in ("<title>Grid few</title>", "seeds 7, 8", "f" * 40, "a" * 64, "Training map unknown"):
        assert text in page
    assert "Fewer than 3 seeds" in page
    assert not any(text in page for text in ('src="http', 'href="', str(tmp_path)))
    print_grid(loaded.file, cells)
    shown = capsys.readouterr().out
    assert "traffic.vehicles" in shown
    assert "detector" not in shown  # the same in all lines
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    assert {"heat1.png", "curve1-1.png", "curve1-2.png"} <= names
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
    write_grid(tmp_path, loaded.file, cells, ["Training map unknown"])
    assert before == {file.name: file.read_bytes() for file in tmp_path.iterdir() if file.is_file()}
