"""Labels of every family that tell something else than the two bags, column by column."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from found_checks import checks_of

from advpipe.stages.verify.run import verify

POINTS, FRAMES = "labels.parquet", "frames.parquet"
CAMS, FIXES = "v2x_labels.parquet", "gnss_labels.parquet"


@pytest.mark.parametrize(
    ("bag", "table", "columns", "check"),
    [
        ("detach", POINTS, ("point", "frame"), "points"),
        ("attach", POINTS, ("displacement_m",), "points"),
        ("attach", FRAMES, ("points_adversarial", "stamp_ns", "frame"), "points"),
        ("cam", CAMS, ("number", "station_id", "time_ns", "sent_ns"), "cams"),
        ("cam", CAMS, ("true_latitude_deg", "true_station_id", "false_longitude_deg"), "cams"),
        ("cam", CAMS, ("false_curvature_per_m", "false_acceleration_control"), "cams"),
        ("delay", CAMS, ("number", "station_id"), "cams"),
        ("dos", CAMS, ("number", "false_speed_mps"), "cams"),
        (
            "gnss",
            FIXES,
            ("stamp_ns", "true_latitude_deg", "false_longitude_deg", "false_altitude_m"),
            "fixes",
        ),
    ],
)
def test_another_number(data_set: Path, bag: str, table: str, columns: tuple[str, ...], check: str) -> None:
    """One more in the last row that has a number there."""
    path = data_set / bag / table
    original = pq.read_table(path)
    for name in columns:
        index = original.column_names.index(name)
        values = original[name].to_pylist()
        row = max(row for row, value in enumerate(values) if value is not None)
        values[row] += 1
        field = original.schema.field(name)
        pq.write_table(original.set_column(index, field, pa.array(values, field.type)), path)
        found = verify(data_set / bag).findings
        assert {finding.check for finding in found} == {"beside", check}, name
    pq.write_table(original, path)
    assert checks_of(data_set / bag) <= {"beside"}


@pytest.mark.parametrize(
    ("bag", "table", "check"),
    [
        *(("detach", POINTS, "points"), ("attach", POINTS, "points"), ("gnss", FIXES, "fixes")),
        *(("cam", CAMS, "cams"), ("delay", CAMS, "cams"), ("dos", CAMS, "cams")),
    ],
)
def test_a_row_that_is_missing(data_set: Path, bag: str, table: str, check: str) -> None:
    path = data_set / bag / table
    rows = pq.read_table(path)
    pq.write_table(rows.slice(0, len(rows) - 1), path)
    assert checks_of(data_set / bag) == {"beside", check}


def test_another_action(data_set: Path) -> None:
    """What was removed is said to have moved."""
    path = data_set / "detach" / POINTS
    rows = pq.read_table(path)
    index = rows.column_names.index("action")
    moved = pc.if_else(pc.equal(pc.cast(rows["action"], pa.string()), "removed"), "moved", "added")
    pq.write_table(rows.set_column(index, "action", moved), path)
    assert checks_of(data_set / "detach") == {"beside", "points"}
