"""The user's table of trajectories, CSV or Parquet: read, and checked row by row before anything starts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64

if TYPE_CHECKING:
    import pyarrow

REQUIRED = ("time_s", "x_m", "y_m", "z_m", "yaw_rad")
OPTIONAL = ("pitch_rad", "roll_rad")
DEFAULT_BODY = "sedan"
LARGEST = 1e7
"""Numbers beyond it are no places on a map, nor times in a drive."""


@dataclass(frozen=True)
class Rows:
    """All rows of one id: values (K, 7) time_s, x_m, y_m, z_m, yaw_rad, pitch_rad, roll_rad; K >= 2."""

    values: Float64
    body: str


def read_trajectory_table(path: Path, bodies: frozenset[str]) -> dict[str, Rows]:
    """The rows of each id, sorted by id.

    Raises AdvpipeError, with row and column, for a file that is no table, a missing column, a number that
    is none or not finite, times of one id that do not rise, an unknown body, and an id with a single row.
    """
    where = f"trajectories.file: {path}"
    columns = _columns(path, where)
    for name in ("id", *REQUIRED):
        if name not in columns:
            raise AdvpipeError(f"{where} has no column {name}; it has {', '.join(columns) or 'none'}")
    ids = _texts(columns["id"], "id", where)
    if not len(ids):
        raise AdvpipeError(f"{where} has no rows")
    present = [_numbers(columns[name], name, where) for name in REQUIRED]
    angles = [
        _numbers(columns[name], name, where) if name in columns else np.zeros(len(ids)) for name in OPTIONAL
    ]
    values = np.stack([*present, *angles], axis=1)
    named = _texts(columns["body"], "body", where) if "body" in columns else [DEFAULT_BODY] * len(ids)
    for row, body in enumerate(named):
        if body not in bodies:
            raise AdvpipeError(
                f"{where}, row {row + 1}, column body: {body!r} is no body; known: "
                f"{', '.join(sorted(bodies))}"
            )
    rows_of: dict[str, list[int]] = {}
    for row, name in enumerate(ids):
        rows_of.setdefault(name, []).append(row)
    return {name: _rows(name, rows, values, named, where) for name, rows in sorted(rows_of.items())}


def _rows(name: str, rows: list[int], values: Float64, bodies: list[str], where: str) -> Rows:
    late = np.flatnonzero(np.diff(values[rows, 0]) <= 0)
    if len(late):
        row = rows[int(late[0]) + 1]
        before_s, time_s = values[rows[int(late[0])], 0], values[row, 0]
        raise AdvpipeError(
            f"{where}, row {row + 1}, column time_s: {time_s:g} does not come after {before_s:g}, "
            f"the row of {name!r} before; sort the rows of each id and drop repeated times"
        )
    if len(rows) == 1:
        raise AdvpipeError(f"{where}, row {rows[0] + 1}: {name!r} has only this row; give it two at least")
    other = next((row for row in rows if bodies[row] != bodies[rows[0]]), None)
    if other is not None:
        raise AdvpipeError(
            f"{where}, row {other + 1}, column body: {name!r} is a {bodies[rows[0]]} in its first row"
        )
    return Rows(values[rows], bodies[rows[0]])


def _columns(path: Path, where: str) -> dict[str, pyarrow.ChunkedArray]:
    import pyarrow
    import pyarrow.csv
    import pyarrow.parquet

    if not path.is_file():
        raise AdvpipeError(f"{where} {'is no file' if path.exists() else 'does not exist'}")
    try:
        with path.open("rb") as file:
            is_parquet = file.read(4) == b"PAR1"
        if is_parquet:
            table = pyarrow.parquet.read_table(path)
        else:
            header = path.open(encoding="utf-8-sig", newline="").readline()
            names = [name.strip().strip('"') for name in header.split(",")]
            texts = {name: pyarrow.string() for name in names}
            convert = pyarrow.csv.ConvertOptions(column_types=texts, strings_can_be_null=False)
            read = pyarrow.csv.ReadOptions(column_names=names, skip_rows=1)
            table = pyarrow.csv.read_csv(path, convert_options=convert, read_options=read)
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError, ValueError) as error:
        raise AdvpipeError(f"{where} is no CSV or Parquet table: {_first_line(error)}") from None
    if len(set(table.column_names)) < len(table.column_names):
        raise AdvpipeError(f"{where} has two columns of the same name")
    return {name: table[name] for name in table.column_names}


def _first_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _texts(column: pyarrow.ChunkedArray, name: str, where: str) -> list[str]:
    texts = [None if value is None else str(value).strip() for value in column.to_pylist()]
    for row, text in enumerate(texts):
        if (
            not text
            or len(text) > 100
            or any(ord(character) < 33 or character in "<>&\"'" for character in text)
        ):
            raise AdvpipeError(
                f"{where}, row {row + 1}, column {name}: {text!r} is no name (1 to 100 characters, no spaces)"
            )
    return [text for text in texts if text]


def _numbers(column: pyarrow.ChunkedArray, name: str, where: str) -> Float64:
    values = column.to_pylist()
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.array([_number(value) for value in values])
    bad = np.flatnonzero(~(np.abs(numbers) <= LARGEST))
    if len(bad):
        value = values[int(bad[0])]
        raise AdvpipeError(
            f"{where}, row {int(bad[0]) + 1}, column {name}: {value!r} is no finite number within {LARGEST:g}"
        )
    return numbers


def _number(value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return float("nan")
