"""What an attack did, as Parquet beside its bag: one row a touched point, and one row a frame."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from advpipe.pipeline.messages.cloud import StampedCloud
from advpipe.stages.attack.lidar.base import LidarResult

LABELS = pa.schema(
    [
        ("topic", pa.dictionary(pa.int32(), pa.string())),
        ("frame", pa.int32()),
        ("stamp_ns", pa.int64()),
        ("point", pa.int32()),
        ("action", pa.dictionary(pa.int32(), pa.string())),
        ("displacement_m", pa.float32()),
    ]
)
"""`labels.parquet`: frame and point are counted in the clean bag's topic; see `lidar.base.PointLabels`."""

FRAMES = pa.schema(
    [
        ("topic", pa.string()),
        ("frame", pa.int32()),
        ("stamp_ns", pa.int64()),
        ("attack", pa.string()),
        ("points_clean", pa.int32()),
        ("points_adversarial", pa.int32()),
        ("loss_before", pa.float64()),
        ("loss_after", pa.float64()),
        ("note", pa.string()),
    ]
)
"""`frames.parquet`: every frame of the attacked topics, also those left as they were.

attack: its word, "" where none was scheduled.
"""


GROUP_ROWS = 1 << 18
"""Of labels at least, in a group of rows, of whole frames: whoever opens the file holds a
kilobyte or more of each group."""


class AttackTables:
    """Writes `labels.parquet` and `frames.parquet` into a folder, frame by frame."""

    def __init__(self, folder: Path) -> None:
        self._labels = pq.ParquetWriter(str(folder / "labels.parquet"), LABELS)
        self._frames = pq.ParquetWriter(str(folder / "frames.parquet"), FRAMES)
        self._rows: list[dict[str, object]] = []
        self._waiting: list[pa.Table] = []

    def __enter__(self) -> AttackTables:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._frames.write_table(pa.Table.from_pylist(self._rows, FRAMES))
        self._frames.close()
        self._write_group()
        self._labels.close()

    def add(self, topic: str, frame: int, attack: str, clean: StampedCloud, result: LidarResult) -> None:
        """One frame, in the order of the bag."""
        self._rows.append(
            {
                "topic": topic,
                "frame": frame,
                "stamp_ns": clean.stamp_ns,
                "attack": attack,
                "points_clean": len(clean.cloud),
                "points_adversarial": len(result.cloud),
                "loss_before": result.loss_before,
                "loss_after": result.loss_after,
                "note": result.note,
            }
        )
        labels = result.labels
        if len(labels) == 0:
            return
        columns = [
            pa.array([topic] * len(labels)).dictionary_encode(),
            pa.array(np.full(len(labels), frame, np.int32)),
            pa.array(np.full(len(labels), clean.stamp_ns, np.int64)),
            pa.array(labels.point.astype(np.int32)),
            pa.array(labels.action.tolist()).dictionary_encode(),
            pa.array(labels.displacement_m.astype(np.float32)),
        ]
        self._waiting.append(pa.Table.from_arrays(columns, schema=LABELS))
        if sum(map(len, self._waiting)) >= GROUP_ROWS:
            self._write_group()

    def _write_group(self) -> None:
        if self._waiting:
            self._labels.write_table(pa.concat_tables(self._waiting).unify_dictionaries())
            self._waiting.clear()
