"""What the tables and pictures of a sweep read from the row of a report that a cell keeps as JSON."""

from __future__ import annotations

from advpipe.pipeline.results.figures import Record
from advpipe.pipeline.results.row import lowest
from advpipe.stages.evaluate.report.table import changed_percent


def strongest_baseline(row: Record) -> str | None:
    """The word of the plain random baseline with the lowest mAP ratio; recipe random-best is none of them."""
    words = row["baselines"]
    found = {str(word): row[f"{word}_map_ratio_percent"] for word in words} if isinstance(words, list) else {}
    return lowest({word: ratio for word, ratio in found.items() if isinstance(ratio, float)})


def changed_points(row: Record) -> str:
    """Points removed, added and moved in percent of all clean points; see `changed_percent`."""
    counts = [row[f"points_{word}"] for word in ("removed", "added", "moved", "clean")]
    removed, added, moved, clean = (each if isinstance(each, int) else 0 for each in counts)
    return changed_percent(removed, added, moved, clean)
