"""Which frames of a bag an attack touches, as the label tables beside its adversarial bag say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.bounded_parquet import batches
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels import clouds, fixes, messages

Runs = list[tuple[int, int]]
"""Frames in a row: the first and the last of each row."""


def attacked_runs(bag: Path, timing_topic: str, times_ns: npt.NDArray[np.int64]) -> Runs:
    """The frames with an attack on their clouds, or on messages or fixes until the next frame.

    timing_topic, times_ns: of the frames. Empty for a bag whose tables are missing or cannot be read.
    """
    folder = bag if bag.is_dir() else bag.parent
    try:
        found = np.concatenate(
            [
                _of_clouds(folder / clouds.FRAMES, timing_topic),
                _of_times(folder / messages.FILE, "time_ns", times_ns),
                _of_times(folder / fixes.FILE, "stamp_ns", times_ns),
            ]
        )
    except AdvpipeError:
        return []
    frames = np.unique(found[(found >= 0) & (found < len(times_ns))])
    rows = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    return [(int(row[0]), int(row[-1])) for row in rows if len(row)]


def _of_clouds(path: Path, topic: str) -> npt.NDArray[np.int64]:
    found = [np.zeros(0, np.int64)]
    for batch in batches(path, ("topic", "frame", "attack")) if path.exists() else ():
        topics, frames, attacks = (column.to_numpy(zero_copy_only=False) for column in batch.columns)
        is_attacked = np.array([bool(name) for name in attacks], bool)
        found.append(frames[(topics == topic) & is_attacked].astype(np.int64))
    return np.concatenate(found)


def _of_times(path: Path, column: str, times_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The last frame before each row with an attack."""
    found = [np.zeros(0, np.int64)]
    for batch in batches(path, (column, "attack")) if path.exists() else ():
        rows_ns, attacks = (each.to_numpy(zero_copy_only=False) for each in batch.columns)
        is_attacked = np.array([bool(name) for name in attacks], bool)
        found.append(np.searchsorted(times_ns, rows_ns[is_attacked].astype(np.int64), "right") - 1)
    return np.concatenate(found)
