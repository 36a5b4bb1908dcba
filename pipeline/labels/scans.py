"""What attacks did to radar scans, as Parquet beside an adversarial bag: a row for each touched return."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.bounded_parquet import ColumnType
from advpipe.pipeline.labels.columns import Columns
from advpipe.pipeline.labels.optional_rows import optional_rows

FILE = "radar_labels.parquet"

ADDED, CHANGED, REMOVED = "added", "changed", "removed"

MEASURED = ("range_m", "azimuth_rad", "elevation_rad", "velocity_mps", "amplitude_db")

SCAN_COLUMNS: Columns = {
    "topic": "string",
    "scan": "int32",
    "stamp_ns": "int64",
    "attack": "string",
    "action": "string",
    "clean": "int32",
    "attacked": "int32",
    **dict.fromkeys(MEASURED, "float32"),
}
"""By time. topic: of the scans; scan: counts them; attack: its name; action: added, changed or
removed; clean, attacked: the place of the return in the clean scan and in this one, null where it is not;
range_m to amplitude_db: of the return, as it is here, of a removed one as it was."""

_READ: dict[str, ColumnType] = {
    **dict.fromkeys(("topic", "attack", "action"), "text"),
    **dict.fromkeys(("scan", "stamp_ns"), "whole"),
}


def read_scan_labels(bag: Path) -> Iterator[dict[str, Any]]:
    """The rows of an adversarial bag, without measurements; none for a bag without attacks on radars.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no such labels.
    """
    return optional_rows(bag, FILE, _READ, "radar")
