"""The user's table of trajectories, CSV or Parquet: read, and checked row by row before anything starts."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.traffic.trajectories.rows import name_in, number_in, table_rows

REQUIRED = ("time_s", "x_m", "y_m", "z_m", "yaw_rad")
OPTIONAL = ("pitch_rad", "roll_rad")
DEFAULT_BODY = "sedan"
MOST_IDS = 20_000
"""Four times as many as `traffic.vehicles` lets drive at a time."""

LARGEST = 1e7
"""Largest absolute value of a place on a map in metres, or of a time in a drive in seconds."""


@dataclass(frozen=True)
class Rows:
    """All rows of one id: values (K, 7) time_s, x_m, y_m, z_m, yaw_rad, pitch_rad, roll_rad; K >= 2."""

    values: Float64
    body: str


def read_trajectory_table(path: Path, bodies: frozenset[str]) -> dict[str, Rows]:
    """The rows of each id, sorted by id.

    Raises AdvpipeError, with line and column, for a file that is not a table, a missing column, an invalid or
    infinite number, times of one id that do not increase, an unknown body, an id with a single row, and more
    than `MOST_ROWS` rows or `MOST_IDS` ids.
    """
    columns, rows = table_rows(path, ("id", *REQUIRED), ("id", *REQUIRED, *OPTIONAL, "body"))
    read = _TableReader(f"trajectories.file: {path}", columns, bodies)
    for place, values in rows:
        read.add(place, values)
    return read.finished()


@dataclass
class _PartialRows:
    """The rows of one id so far, seven numbers each; place: of its first row."""

    place: str
    body: str
    values: array[float] = field(default_factory=lambda: array("d"))
    last_s: float = -np.inf


class _TableReader:
    """Collects rows one by one, and stores only their numbers."""

    def __init__(self, where: str, columns: Sequence[str], bodies: frozenset[str]) -> None:
        self._where, self._columns, self._bodies = where, columns, bodies
        self._rows_of: dict[str, _PartialRows] = {}

    def add(self, place: str, values: Sequence[Any]) -> None:
        """Check and store a row; raises AdvpipeError for an invalid one."""
        given = dict(zip(self._columns, values, strict=True))
        name = self._name(place, "id", given["id"])
        body = self._name(place, "body", given.get("body", DEFAULT_BODY))
        if body not in self._bodies:
            known = ", ".join(sorted(self._bodies))
            raise self._error(place, "body", f"{short_repr(body)} is not a known body; known: {known}")
        numbers = [self._number(place, one, given.get(one, 0.0)) for one in (*REQUIRED, *OPTIONAL)]
        own = self._rows_of.get(name)
        if own is None:
            if len(self._rows_of) >= MOST_IDS:
                raise AdvpipeError(f"{self._where}, {place}: more than {MOST_IDS} ids, too many to simulate")
            own = self._rows_of[name] = _PartialRows(place, body)
        if numbers[0] <= own.last_s:
            rises = f"{numbers[0]:g} does not come after {own.last_s:g}, the row of {short_repr(name)} before"
            hint = "sort the rows of each id and drop repeated times"
            raise self._error(place, "time_s", f"{rises}; {hint}")
        if body != own.body:
            raise self._error(place, "body", f"{short_repr(name)} is a {own.body} in its first row")
        own.last_s = numbers[0]
        own.values.extend(numbers)

    def finished(self) -> dict[str, Rows]:
        """The rows of each id; raises AdvpipeError for no rows, or an id with a single row."""
        if not self._rows_of:
            raise AdvpipeError(f"{self._where} has no rows")
        found: dict[str, Rows] = {}
        for name in sorted(self._rows_of):
            own = self._rows_of.pop(name)
            values = np.frombuffer(own.values, np.float64).reshape(-1, len(REQUIRED) + len(OPTIONAL))
            if len(values) == 1:
                only = f"{self._where}, {own.place}: {short_repr(name)} has only this row"
                raise AdvpipeError(f"{only}; give it at least two")
            found[name] = Rows(values, own.body)
        return found

    def _name(self, place: str, column: str, value: object) -> str:
        try:
            return name_in(value)
        except ValueError as error:
            raise self._error(place, column, str(error)) from None

    def _number(self, place: str, column: str, value: object) -> float:
        number = number_in(value)
        if not abs(number) <= LARGEST:
            raise self._error(place, column, f"{short_repr(value)} is not a finite number within {LARGEST:g}")
        return number

    def _error(self, place: str, column: str, what: str) -> AdvpipeError:
        return AdvpipeError(f"{self._where}, {place}, column {column}: {what}")
