"""The tables of a report for other programs: every detection and object, and the counts of every frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.geometry.boxes import BOX_COLUMNS
from advpipe.stages.evaluate.detection.match_rows import match_rows
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.summary import Summary

_WORDS = pa.dictionary(pa.int32(), pa.string())
MATCH_SCHEMA = pa.schema(
    [
        ("bag", _WORDS),
        ("cloud", _WORDS),
        ("frame", pa.int64()),
        ("stamp_ns", pa.int64()),
        ("kind", _WORDS),
        ("number", pa.int32()),
        ("class", _WORDS),
        ("id", pa.string()),
        ("score", pa.float64()),
        *((column, pa.float64()) for column in BOX_COLUMNS),
        ("points", pa.int64()),
        ("occlusion", pa.float64()),
        *((f"fate_{criterion}", _WORDS) for criterion in CRITERIA),
        *((f"match_{criterion}", pa.int32()) for criterion in CRITERIA),
    ]
)
_FRAMES_AT_ONCE = 100


def write_results(summaries: Sequence[Summary], path: Path) -> None:
    """`results.parquet`: one row a detection and one an object, of every frame, cloud and bag."""
    with pq.ParquetWriter(str(path), MATCH_SCHEMA) as writer:
        for summary in summaries:
            frames = summary.comparison.frames
            for start in range(0, len(frames), _FRAMES_AT_ONCE):
                rows = [
                    {"bag": summary.row["bag"], **row}
                    for frame in frames[start : start + _FRAMES_AT_ONCE]
                    for word in frame.clouds()
                    for row in match_rows(frame, word)
                ]
                writer.write_table(pa.Table.from_pylist(rows, schema=MATCH_SCHEMA))


def write_frames(summaries: Sequence[Summary], path: Path) -> None:
    """`frames.parquet`: one row a frame and bag."""
    rows = [
        {"bag": summary.row["bag"], "attack": summary.row["attack"], "recipe": summary.row["recipe"], **row}
        for summary in summaries
        for row in summary.per_frame
    ]
    schema = pa.schema([(name, _arrow_type(name)) for name in rows[0]])
    pq.write_table(pa.Table.from_pylist(rows, schema=schema), str(path))


def _arrow_type(column: str) -> pa.DataType:
    if column in ("bag", "attack", "recipe"):
        return pa.string()
    return pa.float64() if column.startswith(("max_displacement_m", "chamfer_distance_m2")) else pa.int64()
