"""Tables of trajectories: good ones in both formats, and bad ones named by row and column."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.traffic.trajectories.table import read_trajectory_table

BODIES = frozenset({"sedan", "bus"})
HEAD = "id,time_s,x_m,y_m,z_m,yaw_rad"
GOOD = f"{HEAD},body\nb,0,1,2,3,0.5,bus\na,0.5,1,2,3,0,sedan\nb,1,2,2,3,0.5,bus\na,1.5,4,2,3,0,sedan\n"


def test_rows_are_sorted_by_id(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(GOOD)
    table = read_trajectory_table(tmp_path / "t.csv", BODIES)
    assert list(table) == ["a", "b"]
    assert table["a"].values.tolist() == [[0.5, 1, 2, 3, 0, 0, 0], [1.5, 4, 2, 3, 0, 0, 0]]
    assert (table["a"].body, table["b"].body) == ("sedan", "bus")


def test_parquet_and_csv_give_the_same_rows(tmp_path: Path) -> None:
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
    "": r"is not a CSV or Parquet table|has no column",
    f"{HEAD}\n": r"has no rows|is no CSV",
    "id,time_s,x_m,y_m,z_m\na,0,0,0,0\n": r"has no column yaw_rad; it has id, time_s",
    "PAR1 but no Parquet": r"is not a CSV or Parquet table",
    f"{HEAD}\na,0,0,0,0,0\na,1,nan,0,0,0\n": r"line 3, column x_m: 'nan' is not a finite number",
    f"{HEAD}\na,0,0,0,0,0\na,1,0,0,-inf,0\n": r"line 3, column z_m: '-inf' is not a finite number",
    f"{HEAD}\na,0,0,0,0,0\na,1,0,1e300,0,0\n": r"line 3, column y_m: '1e300' is not a finite number",
    f"{HEAD}\na,0,0,0,0,east\na,1,0,0,0,0\n": r"line 2, column yaw_rad: 'east' is not a finite number",
    f"{HEAD}\na,0,0,,0,0\na,1,0,0,0,0\n": r"line 2, column y_m: '' is not a finite number",
    f"{HEAD}\na,0,0,0,0,0\nb,0,0,0,0,0\na,0,0,0,0,0\n": r"line 4, column time_s: 0 does not come after 0",
    f"{HEAD}\na,2,0,0,0,0\na,1,0,0,0,0\n": r"line 3, column time_s: 1 does not come after 2",
    f"{HEAD}\na,0,0,0,0,0\n": r"line 2: 'a' has only this row",
    f"{HEAD}\n,0,0,0,0,0\n": r"line 2, column id: '' is not a valid name",
    f"{HEAD}\na b,0,0,0,0,0\n": r"line 2, column id: 'a b' is not a valid name",
    f"{HEAD},body\na,0,0,0,0,0,tank\n": r"line 2, column body: 'tank' is not a known body; known: bus, sedan",
    f"{HEAD},body\na,0,0,0,0,0,bus\na,1,0,0,0,0,sedan\n": r"line 3, column body: 'a' is a bus",
    f"{HEAD},x_m\na,0,0,0,0,0,0\n": r"two columns of the same name",
    f"{HEAD}\na,0,0,0,0\n": r"line 2 has 5 fields, the first one 6",
    f"{HEAD}\n\n\na,0,0,0,0\n": r"line 4 has 5 fields",
    f"{HEAD}\na,0,0,0,0,1_0\n": r"line 2, column yaw_rad: '1_0' is not a finite number",
    f"{HEAD}\na,0,0,0,0,{'1' * 100_000}\n": r"line 2 has more than 10000 characters",
    f"{HEAD}\na,0,0,0,0,{'x' * 9000}\n": r"line 2, column yaw_rad: .{,110} is not a finite",
    f'{HEAD}\n"a,0,0,0,0,0\n': r"is not a CSV or Parquet table: unexpected end of data",
    f"{'x' * 9000}\n": r"has no column id; it has .{,310}$",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=range(len(BAD)))
def test_invalid_tables_are_one_line_errors(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(AdvpipeError, match=message) as caught:
        read_trajectory_table(path, BODIES)
    assert "\n" not in str(caught.value)
    assert "t.csv" in str(caught.value)


def test_a_picture_is_refused_as_a_table(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(b"\x89PNG" + bytes(range(256)))
    with pytest.raises(AdvpipeError, match=r"t\.png is not a CSV or Parquet table"):
        read_trajectory_table(tmp_path / "t.png", BODIES)


def test_a_missing_file_is_a_one_line_error(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="does not exist"):
        read_trajectory_table(tmp_path / "none.csv", BODIES)


MEASURE = """
import sys, time
from pathlib import Path
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.traffic.trajectories.table import read_trajectory_table
import pyarrow.parquet
def peak_kib():  # that of `resource` is at least what the process that started this one held
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
before, start = peak_kib(), time.process_time()
try:
    print(sum(len(rows.values) for rows in read_trajectory_table(Path(sys.argv[1]), {"sedan"}).values()))
except AdvpipeError as error:
    print(error)
print((peak_kib() - before) >> 10, time.process_time() - start)
"""


def measured(path: Path) -> tuple[str, float, float]:
    """What reading comes to, how many MiB and seconds it takes."""
    done = subprocess.run([sys.executable, "-c", MEASURE, path], capture_output=True, text=True, check=True)
    output, figures = done.stdout.splitlines()
    peak_mib, time_s = map(float, figures.split())
    return output, peak_mib, time_s


def test_millions_of_compressed_parquet_rows_are_refused_quickly(tmp_path: Path) -> None:
    path, codes = tmp_path / "t.parquet", np.zeros(1 << 20, np.int32)
    columns = [pyarrow.array(["a"]), *[pyarrow.array([0.5])] * 5]
    arrays = [pyarrow.DictionaryArray.from_arrays(codes, one) for one in columns]
    table = pyarrow.Table.from_arrays(arrays, names=HEAD.split(","))
    with pyarrow.parquet.ParquetWriter(path, table.schema, compression="zstd") as writer:
        for _ in range(8):
            writer.write_table(table)
    assert path.stat().st_size < 250_000
    output, peak_mib, time_s = measured(path)
    assert "8388608 rows; at most 5000000" in output
    assert peak_mib < 100
    assert time_s < 5


def test_memory_of_a_long_table_is_near_the_size_of_its_numbers(tmp_path: Path) -> None:
    """200,000 rows of seven numbers: 11 MB; as Python's own values they took ten times that."""
    lines = (f"car{row % 20},{row // 20 * 0.1:.1f},{row % 977},{row % 983},0,0.25" for row in range(200_000))
    (tmp_path / "t.csv").write_text("\n".join((HEAD, *lines)))
    output, peak_mib, time_s = measured(tmp_path / "t.csv")
    assert output == "200000"
    assert peak_mib < 45
    assert time_s < 20


def test_too_many_rows_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("advpipe.stages.simulate.traffic.trajectories.rows.MOST_ROWS", 3)
    (tmp_path / "t.csv").write_text(GOOD)
    with pytest.raises(AdvpipeError, match=r"t\.csv has more than 3 rows"):
        read_trajectory_table(tmp_path / "t.csv", BODIES)


def test_too_many_ids_are_refused(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("\n".join((HEAD, *(f"car{row},0,0,0,0,0" for row in range(20_001)))))
    with pytest.raises(AdvpipeError, match=r"line 20002: more than 20000 ids"):
        read_trajectory_table(tmp_path / "t.csv", BODIES)


def test_roll_alone_stays_in_its_column(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{HEAD},roll_rad\na,0,1,2,3,4,0.5\na,1,1,2,3,4,0.25\n")
    table = read_trajectory_table(tmp_path / "t.csv", BODIES)
    assert table["a"].values.tolist() == [[0, 1, 2, 3, 4, 0, 0.5], [1, 1, 2, 3, 4, 0, 0.25]]
