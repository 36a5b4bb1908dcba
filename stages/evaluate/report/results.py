"""The tables of a report for other programs: every detection and object, and the counts of every frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.results.tables import MATCH_SCHEMA
from advpipe.stages.evaluate.detection.match_rows import match_rows
from advpipe.stages.evaluate.detection.summary import Summary

_FRAMES_AT_ONCE = 100
_ABOUT = ("bag", "detector", "attack", "recipe")
_LENGTHS = ("max_added_m", "chamfer_distance_m2")


def write_results(summaries: Sequence[Summary], path: Path) -> None:
    """`results.parquet`: one row a detection and one an object, of every frame, cloud and bag."""
    with pq.ParquetWriter(str(path), MATCH_SCHEMA) as writer:
        for summary in summaries:
            frames = summary.comparison.frames
            for start in range(0, len(frames), _FRAMES_AT_ONCE):
                rows = [
                    {"bag": summary.result.bag, "detector": summary.result.detector, **row}
                    for frame in frames[start : start + _FRAMES_AT_ONCE]
                    for word in frame.all_clouds()
                    for row in match_rows(frame, word, summary.min_score)
                ]
                writer.write_table(pa.Table.from_pylist(rows, schema=MATCH_SCHEMA))


def write_frames(summaries: Sequence[Summary], path: Path) -> None:
    """`frames.parquet`: one row a frame and bag."""
    rows = [
        {
            "bag": summary.result.bag,
            "detector": summary.result.detector,
            "attack": summary.result.attack.attack,
            "recipe": summary.result.attack.recipe,
            **row,
        }
        for summary in summaries
        for row in summary.per_frame
    ]
    schema = pa.schema([(name, _arrow_type(name)) for name in rows[0]])
    pq.write_table(pa.Table.from_pylist(rows, schema=schema), str(path))


def _arrow_type(column: str) -> pa.DataType:
    if column in _ABOUT:
        return pa.string()
    return pa.float64() if "displacement_m" in column or column.startswith(_LENGTHS) else pa.int64()
