"""What attacks did to the objects in CPMs, as Parquet beside an adversarial bag: a row for each object."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.bounded_parquet import ColumnType, rows
from advpipe.pipeline.labels.columns import Columns

OBJECT_FILE = "cpm_labels.parquet"

OBJECT_ADDED, OBJECT_REMOVED, OBJECT_CHANGED = "added", "removed", "changed"

OBJECT_COLUMNS: Columns = {
    "number": "uint64",
    "station_id": "uint32",
    "time_ns": "int64",
    "attack": "string",
    "action": "string",
    "object_id": "int64",
    "true_x_m": "float64",
    "true_y_m": "float64",
    "false_x_m": "float64",
    "false_y_m": "float64",
}
"""number, station_id, time_ns: of the message, as in `MESSAGE_COLUMNS`. attack: whose editor did it. action:
added, removed or changed. object_id: the sender's. true_..., false_...: the centre of its box in the map's
frame, before and after the attack; null where there is none."""

_READ: dict[str, ColumnType] = {
    **dict.fromkeys(("number", "station_id", "time_ns", "object_id"), "whole"),
    **dict.fromkeys(("attack", "action"), "text"),
}


@dataclass(frozen=True, slots=True)
class ObjectLabel:
    """What an attack did to one object of a message."""

    number: int
    station_id: int
    time_ns: int
    object_id: int
    attack: str
    action: str


def read_object_labels(bag: Path) -> list[ObjectLabel]:
    """The labels of an adversarial bag; empty where no attack changed objects.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no labels.
    """
    path = (bag.parent if bag.is_file() else bag) / OBJECT_FILE
    if not path.exists():
        return []
    return [ObjectLabel(**row) for row in rows(path, _READ)]


def write_object_labels(folder: Path, labels: list[dict[str, Any]]) -> None:
    """Write the file; labels: rows of `OBJECT_COLUMNS`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from advpipe.pipeline.labels.columns import arrow_schema

    table = pa.Table.from_pylist(labels, arrow_schema(OBJECT_COLUMNS))
    pq.write_table(table, folder / OBJECT_FILE)
