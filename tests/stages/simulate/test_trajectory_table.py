"""Tables of trajectories: good ones in both formats, and bad ones named by row and column."""

from __future__ import annotations

from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.simulate.trajectory_table import read_trajectory_table

BODIES = frozenset({"sedan", "bus"})
HEAD = "id,time_s,x_m,y_m,z_m,yaw_rad"
GOOD = f"{HEAD},body\nb,0,1,2,3,0.5,bus\na,0.5,1,2,3,0,sedan\nb,1,2,2,3,0.5,bus\na,1.5,4,2,3,0,sedan\n"


def test_rows_are_sorted_by_id(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(GOOD)
    table = read_trajectory_table(tmp_path / "t.csv", BODIES)
    assert list(table) == ["a", "b"]
    assert table["a"].values.tolist() == [[0.5, 1, 2, 3, 0, 0, 0], [1.5, 4, 2, 3, 0, 0, 0]]
    assert (table["a"].body, table["b"].body) == ("sedan", "bus")


def test_parquet_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(GOOD)
    rows = [line.split(",") for line in GOOD.splitlines()]
    columns = {
        name: [row[index] if name in ("id", "body") else float(row[index]) for row in rows[1:]]
        for index, name in enumerate(rows[0])
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "t.parquet")
    first, second = (read_trajectory_table(tmp_path / name, BODIES) for name in ("t.csv", "t.parquet"))
    assert all((first[name].values == second[name].values).all() for name in first)


BAD = {
    "": r"is no CSV or Parquet table|has no column",
    f"{HEAD}\n": r"has no rows|is no CSV",
    "id,time_s,x_m,y_m,z_m\na,0,0,0,0\n": r"has no column yaw_rad; it has id, time_s",
    "PAR1 but no Parquet": r"is no CSV or Parquet table",
    f"{HEAD}\na,0,0,0,0,0\na,1,nan,0,0,0\n": r"row 2, column x_m: 'nan' is no finite number",
    f"{HEAD}\na,0,0,0,0,0\na,1,0,0,-inf,0\n": r"row 2, column z_m: '-inf' is no finite number",
    f"{HEAD}\na,0,0,0,0,0\na,1,0,1e300,0,0\n": r"row 2, column y_m: '1e300' is no finite number",
    f"{HEAD}\na,0,0,0,0,east\na,1,0,0,0,0\n": r"row 1, column yaw_rad: 'east' is no finite number",
    f"{HEAD}\na,0,0,,0,0\na,1,0,0,0,0\n": r"row 1, column y_m: '' is no finite number",
    f"{HEAD}\na,0,0,0,0,0\nb,0,0,0,0,0\na,0,0,0,0,0\n": r"row 3, column time_s: 0 does not come after 0",
    f"{HEAD}\na,2,0,0,0,0\na,1,0,0,0,0\n": r"row 2, column time_s: 1 does not come after 2",
    f"{HEAD}\na,0,0,0,0,0\n": r"row 1: 'a' has only this row",
    f"{HEAD}\n,0,0,0,0,0\n": r"row 1, column id: '' is no name",
    f"{HEAD}\na b,0,0,0,0,0\n": r"row 1, column id: 'a b' is no name",
    f"{HEAD},body\na,0,0,0,0,0,tank\n": r"row 1, column body: 'tank' is no body; known: bus, sedan",
    f"{HEAD},body\na,0,0,0,0,0,bus\na,1,0,0,0,0,sedan\n": r"row 2, column body: 'a' is a bus",
    f"{HEAD},x_m\na,0,0,0,0,0,0\n": r"two columns of the same name",
    f"{HEAD}\na,0,0,0,0\n": r"is no CSV or Parquet table",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=range(len(BAD)))
def test_bad_tables_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(AdvpipeError, match=message) as caught:
        read_trajectory_table(path, BODIES)
    assert "\n" not in str(caught.value)
    assert "t.csv" in str(caught.value)


def test_a_picture_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(b"\x89PNG" + bytes(range(256)))
    with pytest.raises(AdvpipeError, match=r"t\.png is no CSV or Parquet table"):
        read_trajectory_table(tmp_path / "t.png", BODIES)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="does not exist"):
        read_trajectory_table(tmp_path / "none.csv", BODIES)
