"""`advpipe grid` from the drive to the page, on drives of the smoke scenario of one frame."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from grids import write_grid_file

import advpipe
from advpipe.pipeline.campaigns.grid import run as grid_run
from advpipe.pipeline.core.errors import AdvpipeError, UsageError


def run(file: Path, out: Path, **options: object) -> list[dict[str, object]]:
    return advpipe.grid(file, out=out, workers=1, **options).to_dicts()  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("file")
    return write_grid_file(folder, factors={"traffic.vehicles": [40, 30]}, defences=["none", "jitter:0.02"])


@pytest.fixture(scope="module")
def out(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("grid") / "out"
    run(file, out)
    return out


def stamps(out: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in (out / "cells").iterdir()}


def test_every_cell_is_there(out: Path) -> None:
    rows = pq.read_table(out / "grid.parquet").to_pylist()
    whole = [row for row in rows if row["stratum"] == "all"]
    assert [(row["traffic.vehicles"], row["defence"]) for row in whole] == [
        (vehicles, defence) for vehicles in (40.0, 30.0) for defence in ("none", "jitter:0.02")
    ]
    assert len(stamps(out)) == 4
    assert all(0 <= row["map_clean"] <= 1 and 0 <= row["map_adv"] <= 1 for row in whole)
    assert all(row["points_removed"] > 0 for row in whole if row["defence"] == "none")
    assert len({row["clean_sha256"] for row in whole}) == 2
    assert {path.name for drive in (out / "drives").iterdir() for path in drive.iterdir()} == {
        *("clean", "scenario.yaml"),
    }


def test_only_what_is_missing_is_run(
    file: Path, out: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    before = stamps(out)
    lost = next(path for path in sorted((out / "cells").iterdir()))
    lost.unlink()  # as if killed before it was there
    run(file, out)
    assert "4 cells of 2 drives: 3 kept" in capsys.readouterr().out
    after = stamps(out)
    assert [name for name in before if before[name] != after[name]] == [lost.name]
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == files
    monkeypatch.setattr(grid_run, "code_sha256", lambda *parts: "7" * 64)
    with pytest.raises(UsageError, match="was made by other code of advpipe"):
        run(file, out)


def test_a_damaged_cell_and_a_strange_folder_are_named(file: Path, out: Path, tmp_path: Path) -> None:
    cell = next(path for path in sorted((out / "cells").iterdir()))
    (tmp_path / "out" / "cells").mkdir(parents=True)
    (tmp_path / "out" / "cells" / cell.name).write_text("[]")
    with pytest.raises(AdvpipeError, match=rf"{cell.name}.*remove it to compute it again"):
        run(file, tmp_path / "out")
    (tmp_path / "diary.txt").write_text("dear diary")
    with pytest.raises(UsageError, match="no cells/, so it is no grid"):
        run(file, tmp_path)


def test_cells_of_a_drive_with_other_bytes_are_not_mixed_in(file: Path, out: Path, tmp_path: Path) -> None:
    copy = tmp_path / "out"
    shutil.copytree(out, copy)
    lost, kept, *_ = sorted((copy / "cells").iterdir())  # of one drive: names begin with it
    whole = {path.name: path.read_bytes() for path in (copy / "cells").iterdir()}
    lost.unlink()
    stored = json.loads(kept.read_text())
    stored["origin"]["clean_sha256"] = "0" * 64
    kept.write_text(json.dumps(stored))
    with pytest.raises(UsageError, match=r"is not the drive of its finished cells \(SHA-256 "):
        run(file, copy)
    run(file, copy, overwrite=True)
    assert {path.name: path.read_bytes() for path in (copy / "cells").iterdir()} == whole


def test_the_cell_without_an_object_is_named(tmp_path: Path) -> None:
    empty = dict.fromkeys(("traffic.vehicles", "traffic.pedestrians", "traffic.parked_per_km"), 0)
    file = write_grid_file(
        tmp_path,
        factors={"density": {"empty": empty}},
        defences=["none", "jitter:0.02"],
    )
    cell = r"seed1-\w{12} \(density = empty\), detach, small: "
    with pytest.raises(AdvpipeError, match=f"^{cell}detach: in 1 frame no object of a class"):
        run(file, tmp_path / "out")
