"""Rows of the user's table of trajectories, one after the other, from CSV or Parquet."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

from advpipe.pipeline.core.bounded_parquet import batches, flat_columns
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr, shorten

MOST_ROWS = 5_000_000
"""An hour of 140 vehicles at 10 Hz; all rows are held in memory, in 64 bytes each."""

LONGEST_LINE = 10_000
"""Characters of a line of CSV; ours have some hundred."""

Row = tuple[str, Sequence[Any]]
"""The place in the file, such as "line 3" or "row 2", and the values in the order of the columns."""


def table_rows(path: Path, needed: Sequence[str], known: Sequence[str]) -> tuple[list[str], Iterator[Row]]:
    """The `known` columns that a table has, and an iterator over its rows.

    Raises AdvpipeError, also during iteration, for a file that is not a table, lacks a `needed` column or has
    more than `MOST_ROWS` rows, and for a line of CSV that is too long or has a wrong number of fields.
    """
    where = f"trajectories.file: {path}"
    if not path.is_file():
        raise AdvpipeError(f"{where} {'is not a file' if path.exists() else 'does not exist'}")
    with path.open("rb") as file:
        is_parquet = file.read(4) == b"PAR1"
    if is_parquet:
        found = _parquet_columns(path, where)
        names = [*(name for name in known if name in found), *sorted(found - set(known))]
        _check_columns(names, needed, where)
        present = [name for name in known if name in names]
        return present, _parquet_rows(path, present, where)
    lines = _lines(path, where)
    names = [name.strip() for name in next(lines, (0, []))[1]]
    _check_columns(names, needed, where)
    present = [name for name in known if name in names]
    return present, _csv_rows(lines, names, present, where)


def _check_columns(names: Sequence[str], needed: Sequence[str], where: str) -> None:
    if len(set(names)) < len(names):
        raise AdvpipeError(f"{where} has two columns of the same name")
    for name in needed:
        if name not in names:
            has = shorten(", ".join(map(shorten, names)), 300) or "none"
            raise AdvpipeError(f"{where} has no column {name}; it has {has}")


def _parquet_columns(path: Path, where: str) -> set[str]:
    try:
        return flat_columns(path)
    except AdvpipeError as error:
        raise _unreadable(path, where, error) from None


def _parquet_rows(path: Path, columns: Sequence[str], where: str) -> Iterator[Row]:
    number = 0
    try:
        for batch in batches(path, columns, most_rows=MOST_ROWS):
            for values in zip(*(batch.column(name).to_pylist() for name in columns), strict=True):
                number += 1
                yield f"row {number}", values
    except AdvpipeError as error:
        raise _unreadable(path, where, error) from None


def _csv_rows(
    lines: Iterator[tuple[int, list[str]]], names: Sequence[str], columns: Sequence[str], where: str
) -> Iterator[Row]:
    places = [names.index(name) for name in columns]
    for count, (number, fields) in enumerate(lines, 1):
        if count > MOST_ROWS:
            raise AdvpipeError(f"{where} has more than {MOST_ROWS} rows; remove those after the drive's end")
        if len(fields) != len(names):
            raise AdvpipeError(f"{where}, line {number} has {len(fields)} fields, the first one {len(names)}")
        yield f"line {number}", [fields[place] for place in places]


def _lines(path: Path, where: str) -> Iterator[tuple[int, list[str]]]:
    """The fields of each line that is not empty, and its number."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(_bounded(file, where), strict=True)
            for fields in reader:
                if fields:
                    yield reader.line_num, fields
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _not_a_table(where, error) from None


def _bounded(file: TextIO, where: str) -> Iterator[str]:
    number = 0
    while line := file.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise AdvpipeError(f"{where}, line {number} has more than {LONGEST_LINE} characters")
        yield line


def _unreadable(path: Path, where: str, error: AdvpipeError) -> AdvpipeError:
    reason = str(error).removeprefix(f"{path}: ").removeprefix("not a complete Parquet file ")
    return AdvpipeError(f"{where} is not a CSV or Parquet table: {reason}")


def _not_a_table(where: str, error: Exception) -> AdvpipeError:
    return AdvpipeError(
        f"{where} is not a CSV or Parquet table: {shorten(' '.join(str(error).split()), 200)}"
    )


def number_in(value: object) -> float:
    """The number in a field of the table; NaN for any other value."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, str):
        is_number = value.isascii() and "_" not in value
    try:
        return float(value) if is_number else float("nan")  # type: ignore[arg-type]
    except (ValueError, OverflowError):
        return float("nan")


def name_in(value: object) -> str:
    """The name in a field of the table; raises ValueError for an invalid name."""
    text = "" if value is None else str(value).strip()
    if not text or len(text) > 100 or any(ord(sign) < 33 or sign in "<>&\"'" for sign in text):
        raise ValueError(f"{short_repr(text)} is not a valid name (1 to 100 characters, no spaces)")
    return text
