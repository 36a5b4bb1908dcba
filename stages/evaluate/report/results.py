"""The tables of a report for other programs: every detection and object, and the counts of every frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow.parquet as pq

from advpipe.pipeline.results.tables import frame_table, match_schema, match_table
from advpipe.stages.evaluate.detection.baseline import baseline_names
from advpipe.stages.evaluate.detection.match_rows import match_rows
from advpipe.stages.evaluate.detection.summary import Summary

_FRAMES_AT_ONCE = 100


def write_results(summaries: Sequence[Summary], path: Path) -> None:
    """`results.parquet`: one row a detection and one an object, of every frame, cloud and bag."""
    with pq.ParquetWriter(str(path), match_schema()) as writer:
        for summary in summaries:
            frames = summary.comparison.frames
            for start in range(0, len(frames), _FRAMES_AT_ONCE):
                rows = [
                    row
                    for frame in frames[start : start + _FRAMES_AT_ONCE]
                    for condition in frame.all_clouds()
                    for row in match_rows(summary.result, frame, condition, summary.min_score)
                ]
                writer.write_table(match_table(rows))


def write_frames(summaries: Sequence[Summary], path: Path) -> None:
    """`frames.parquet`: one row a frame and bag."""
    rows = [(summary.result, summary.per_frame) for summary in summaries]
    pq.write_table(frame_table(rows, ("clean", "adv", *baseline_names())), str(path))
