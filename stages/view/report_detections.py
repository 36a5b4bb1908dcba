"""The detections of a report of the data set, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.core.bounded_parquet import batches
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.dataset.layout import REPORT_NAME, REPORTS_NAME
from advpipe.pipeline.dataset.reports import DetectionRow, ReportDocument, read_report
from advpipe.pipeline.geometry.boxes import BOX_COLUMNS, count_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.results import match_row
from advpipe.pipeline.viewer.scene import (
    ALWAYS,
    ATTACKED,
    CLEAN,
    DISPLACED,
    FALSE,
    FOUND,
    HIT,
    IGNORED,
    LOST,
    MISSED,
    SceneBox,
    prediction_box,
)

TABLE = "results.parquet"
_COLUMNS = (
    *("bag", "detector", "cloud", "frame", "stamp_ns", "kind", "number", "class", "id", "score"),
    *BOX_COLUMNS,
    *("points", "fate_loose", "match_loose", "is_lost", "is_displaced"),
)
_PREDICTION_OUTCOMES = {match_row.FOUND: HIT, match_row.FALSE: FALSE, match_row.IGNORED: IGNORED}
Row = dict[str, Any]


@dataclass(frozen=True)
class FrameDetections:
    """What a report knows of a frame. scores: of each object by its id, on each cloud."""

    outcomes: dict[str, str]
    scores: dict[str, tuple[str, ...]]
    predictions: tuple[SceneBox, ...]
    min_score: float


class ReportDetections:
    """The detections on one bag and its clean one, as a report has them; a small part of it is in memory.

    Raises AdvpipeError for a report that cannot be read.
    """

    def __init__(self, report: Path, row: DetectionRow) -> None:
        self.name, self.min_score = f"{report.parent.name}/{report.name}", float(row.working_score or 0.0)
        self._table = _rows_of(report / TABLE, str(row.bag), row.detector)
        self._frames = self._table["frame"].to_numpy()

    def frame(self, index: int, before: Frame, attacked: Cloud | None) -> FrameDetections | None:
        """The detections of a frame of the clean bag; None without, or where they are of other clouds."""
        rows = self._table.take(np.flatnonzero(self._frames == index)).to_pylist()
        clouds = {"clean": before.cloud} | ({} if attacked is None else {"adv": attacked})
        rows = [row for row in rows if row["cloud"] in clouds]
        if not rows or any(row["stamp_ns"] != before.stamp_ns for row in rows):
            return None
        found = {name: _of(rows, name, match_row.DETECTION) for name in clouds}
        if not all(_are_on(found[name], cloud) for name, cloud in clouds.items()):
            return None
        last = list(clouds)[-1]
        truth = {name: {row["id"]: row for row in _of(rows, name, match_row.TRUTH)} for name in clouds}
        seen = {name: {row["number"]: row["score"] for row in found[name]} for name in clouds}
        conditions = {"clean": CLEAN, "adv": ATTACKED} if attacked is not None else {"clean": ALWAYS}
        return FrameDetections(
            {
                each: self._outcome(truth["clean"][each], row, seen["clean"])
                for each, row in truth[last].items()
                if each in truth["clean"]
            },
            {
                each: tuple(_score(truth[name].get(each), seen[name]) for name in clouds)
                for each in truth["clean"]
            },
            tuple(
                prediction_box(
                    [row[name] for name in BOX_COLUMNS],
                    row["class"],
                    row["score"],
                    row["points"],
                    outcome=_PREDICTION_OUTCOMES.get(row["fate_loose"], IGNORED),
                    condition=conditions[name],
                )
                for name in clouds
                for row in found[name]
                if row["score"] >= self.min_score
            ),
            self.min_score,
        )

    def _outcome(self, clean: Row, row: Row, scores: dict[int, float]) -> str:
        """As in the report, at its working point."""
        if clean["fate_loose"] == match_row.IGNORED:
            return IGNORED
        if row["is_lost"] and row["cloud"] != "clean":
            return LOST
        if row["is_displaced"] and row["cloud"] != "clean":
            return DISPLACED
        return FOUND if scores.get(clean["match_loose"], -1.0) >= self.min_score else MISSED


def _document(report: Path) -> ReportDocument | AdvpipeError:
    try:
        document = read_report(report / REPORT_NAME)
    except AdvpipeError as error:
        return error
    if not isinstance(document, ReportDocument) or not (report / TABLE).is_file():
        return UsageError(
            f"{report} has no detections: it is no report of `advpipe evaluate`, or of no LiDAR"
        )
    return document


def find_detections(reports: Sequence[Path], bag: str | None) -> ReportDetections | None:
    """The detections of the first report that holds a bag, or, for None, any clean one; None without one."""
    for report in reports:
        document = _document(report)
        rows = document.rows if isinstance(document, ReportDocument) else ()
        if found := next((row for row in rows if row.bag and bag in (None, row.bag)), None):
            return ReportDetections(report, found)
    return None


def reports_of(dataset: Path, chosen: Path | None) -> list[Path]:
    """The reports of a data set by name, or the chosen one, which raises AdvpipeError without detections."""
    if chosen is None:
        return sorted(path.parent for path in (dataset / REPORTS_NAME).glob(f"[!.]*/{REPORT_NAME}"))
    if isinstance(found := _document(chosen), AdvpipeError):
        raise found
    return [chosen]


def _rows_of(path: Path, bag: str, detector: str) -> Any:
    """The rows of a bag's clean and attacked clouds as a `pyarrow.Table`."""
    import pyarrow as pa

    parts = []
    for batch in batches(path, _COLUMNS):
        bags, detectors, clouds = (_values(batch, name) for name in ("bag", "detector", "cloud"))
        wanted = (bags == bag) & (detectors == detector) & np.isin(clouds, ["clean", "adv"])
        parts.append(batch.take(pa.array(np.flatnonzero(wanted))))
    return pa.Table.from_batches(parts)


def _values(batch: Any, name: str) -> npt.NDArray[np.generic]:
    return np.asarray(batch.column(name).to_numpy(zero_copy_only=False))


def _of(rows: Sequence[Row], cloud: str, kind: str) -> list[Row]:
    return [row for row in rows if row["cloud"] == cloud and row["kind"] == kind]


def _are_on(detections: Sequence[Row], cloud: Cloud) -> bool:
    """Whether detections were made on this cloud: their boxes hold as many points as the report says."""
    boxes = np.array([[row[name] for name in BOX_COLUMNS] for row in detections]).reshape(-1, 7)
    stated = np.array([row["points"] for row in detections])
    return bool((count_points(xyz(cloud), boxes) == stated).all())


def _score(truth: Row | None, scores: dict[int, float]) -> str:
    score = None if truth is None else scores.get(truth["match_loose"])
    return "no box" if score is None else f"{score:.2f}"
