"""What an attack did to clouds, as Parquet beside its bag: a row for each touched point and each frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.bounded_parquet import batches, flat_columns
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.columns import Columns, arrow_schema
from advpipe.pipeline.labels.points import ACTIONS, PointLabels
from advpipe.pipeline.messages.cloud import StampedCloud

POINTS, FRAMES = "labels.parquet", "frames.parquet"

POINT_COLUMNS: Columns = {
    "topic": "words",
    "frame": "int32",
    "stamp_ns": "int64",
    "point": "int32",
    "action": "words",
    "displacement_m": "float32",
    "attacked": "int32",
}
"""Of `labels.parquet`: frame and point are counted in the clean bag's topic; see `PointLabels`. attacked: the
index in the adversarial cloud, -1 for a removed point; tables of older versions lack it."""

REPEATED = ["topic", "frame", "stamp_ns", "action"]
"""Columns of few values each. A dictionary of the others would hold each row, and take most of the time."""

FRAME_COLUMNS: Columns = {
    "topic": "string",
    "frame": "int32",
    "stamp_ns": "int64",
    "attack": "string",
    "points_clean": "int32",
    "points_adversarial": "int32",
    "loss_before": "float64",
    "loss_after": "float64",
    "note": "string",
}
"""Of `frames.parquet`: every frame of the attacked topics, changed or not.

attack: its name; "" where no attack was active.
"""

GROUP_ROWS = 1 << 18
"""Labels in a row group, at least, and of whole frames: a reader holds a kilobyte or more for each group."""

GROUP_FRAMES = 1 << 15
"""Rows of frames in a row group: an hour at 10 Hz."""


@dataclass(frozen=True)
class LabelledFrame:
    """One frame of an attacked topic; see `FRAME_COLUMNS`."""

    topic: str
    frame: int
    attack: str
    clean: StampedCloud
    points_adversarial: int
    loss_before: float = np.nan
    loss_after: float = np.nan
    note: str = ""


class PointTables:
    """Writes `labels.parquet` and `frames.parquet` into a folder, frame by frame."""

    def __init__(self, folder: Path) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        pa.array(np.zeros(0))  # loads pandas where it is installed: some seconds, not at the first frame
        self._points, self._frames = arrow_schema(POINT_COLUMNS), arrow_schema(FRAME_COLUMNS)
        self._points_writer = pq.ParquetWriter(str(folder / POINTS), self._points, use_dictionary=REPEATED)
        self._frames_writer = pq.ParquetWriter(str(folder / FRAMES), self._frames)
        self._rows: list[dict[str, object]] = []
        self._waiting: list[Any] = []
        self._waiting_rows = 0

    def __enter__(self) -> PointTables:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._write_frames()
        self._frames_writer.close()
        self._write_group()
        self._points_writer.close()

    def add(self, frame: LabelledFrame, labels: PointLabels) -> None:
        """Write a frame, in the order of the bag, and the labels of its touched points."""
        import pyarrow as pa

        self._rows.append(
            {
                "topic": frame.topic,
                "frame": frame.frame,
                "stamp_ns": frame.clean.stamp_ns,
                "attack": frame.attack,
                "points_clean": len(frame.clean.cloud),
                "points_adversarial": frame.points_adversarial,
                "loss_before": frame.loss_before,
                "loss_after": frame.loss_after,
                "note": frame.note,
            }
        )
        if len(self._rows) >= GROUP_FRAMES:
            self._write_frames()
        if len(labels) == 0:
            return
        columns = [
            pa.DictionaryArray.from_arrays(np.zeros(len(labels), np.int32), [frame.topic]),
            pa.array(np.full(len(labels), frame.frame, np.int32)),
            pa.array(np.full(len(labels), frame.clean.stamp_ns, np.int64)),
            pa.array(labels.point.astype(np.int32)),
            _encoded(labels.action),
            pa.array(labels.displacement_m.astype(np.float32)),
            pa.array(labels.places(len(frame.clean.cloud)).astype(np.int32)),
        ]
        self._waiting.append(pa.Table.from_arrays(columns, schema=self._points))
        self._waiting_rows += len(labels)
        if self._waiting_rows >= GROUP_ROWS:
            self._write_group()

    def _write_frames(self) -> None:
        import pyarrow as pa

        rows, self._rows = self._rows, []
        self._frames_writer.write_table(pa.Table.from_pylist(rows, self._frames))

    def _write_group(self) -> None:
        import pyarrow as pa

        if self._waiting:
            self._points_writer.write_table(pa.concat_tables(self._waiting).unify_dictionaries())
            self._waiting, self._waiting_rows = [], 0


def _encoded(actions: npt.NDArray[np.str_]) -> Any:
    """Actions (K,) as a dictionary array, whose words are in the order in which they come first."""
    import pyarrow as pa

    places = [(np.flatnonzero(actions == action), action) for action in ACTIONS]
    present = sorted((int(where[0]), action, where) for where, action in places if len(where))
    codes = np.zeros(len(actions), np.int32)
    for code, (_, _, where) in enumerate(present):
        codes[where] = code
    return pa.DictionaryArray.from_arrays(codes, [action for _, action, _ in present])


MOST_LABELS = 1 << 22
"""Labels of one frame, at most: twice the rays of the largest simulated LiDAR; real ones have a tenth."""

_READ = ("topic", "frame", "point", "action", "displacement_m")
_NEWER = "attacked"


@dataclass(frozen=True)
class FrameLabels:
    """The labels of the touched points of one frame."""

    topic: str
    frame: int
    labels: PointLabels


def read_point_labels(path: Path) -> Iterator[FrameLabels]:
    """The labels of each frame in turn, also where they span several batches.

    The file is untrusted. Raises AdvpipeError for a file that is no table of labels, or that holds more
    labels of one frame than any cloud has points.
    """
    topic, frame, held, count = "", -1, list[PointLabels](), 0
    columns = (*_READ, _NEWER) if _NEWER in flat_columns(path) else _READ
    for batch in batches(path, columns):
        topics, frames, *values = (batch.column(name).to_numpy(zero_copy_only=False) for name in columns)
        ends = np.flatnonzero((topics[1:] != topics[:-1]) | (frames[1:] != frames[:-1])) + 1
        for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(frames)], strict=True):
            if start == end:
                continue
            if held and (topic, frame) != (str(topics[start]), int(frames[start])):
                yield FrameLabels(topic, frame, _joined(held))
                held, count = [], 0
            topic, frame = str(topics[start]), int(frames[start])
            held.append(PointLabels(*(one[start:end] for one in values)))
            count += end - start
            if count > MOST_LABELS:
                raise AdvpipeError(f"{POINTS}: frame {frame} has more labels than any cloud has points")
    if held:
        yield FrameLabels(topic, frame, _joined(held))


def _joined(parts: Sequence[PointLabels]) -> PointLabels:
    point, action, displacement_m = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("point", "action", "displacement_m")
    )
    attacked = [part.attacked for part in parts if part.attacked is not None]
    with np.errstate(invalid="ignore"):  # NaN becomes the index of no point
        return PointLabels(
            point.astype(np.int64),
            action,
            displacement_m.astype(np.float64),
            np.concatenate(attacked).astype(np.int64) if attacked else None,
        )
