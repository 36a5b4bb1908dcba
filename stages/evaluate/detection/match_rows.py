"""Every detection and every object of a frame, and whether each was matched."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import BOX_COLUMNS, CLASSES
from advpipe.pipeline.results.match_row import (
    DETECTION,
    FALSE,
    FOUND,
    IGNORED,
    MISSED,
    TRUTH,
    MatchRow,
)
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.frame_row import (
    displaced_objects,
    lost_objects,
    new_false_positives,
)
from advpipe.stages.evaluate.detection.matches import labelled
from advpipe.stages.evaluate.detection.scoring import CRITERIA

Column = npt.NDArray[np.generic]


def match_rows(result: ResultRow, frame: FrameResult, condition: str, min_score: float) -> Iterator[MatchRow]:
    """Each detection under a condition, then each object; `min_score` is the working point."""
    cloud, truth = frame.all_clouds()[condition], frame.truth
    lost = lost_objects(frame.clean, cloud, min_score)
    displaced = displaced_objects(frame.clean, cloud, min_score)
    new = new_false_positives(frame.clean, cloud, min_score)
    emptied = cloud.emptied if len(cloud.emptied) else np.zeros(len(truth.boxes), dtype=bool)
    outcomes = _outcomes(frame, cloud)
    for kind, boxes, labels, points in (
        (DETECTION, cloud.detections.boxes, cloud.detections.labels, cloud.box_points),
        (TRUTH, truth.boxes.geometry, truth.boxes.labels, truth.points),
    ):
        is_truth = kind == TRUTH
        for number in range(len(boxes)):
            box: dict[str, Any] = dict(zip(BOX_COLUMNS, map(float, boxes[number]), strict=True))
            yield MatchRow(
                bag=result.bag,
                detector=result.detector,
                cloud=condition,
                frame=frame.index,
                stamp_ns=frame.stamp_ns,
                kind=kind,
                number=number,
                class_name=CLASSES[labels[number]],
                id=truth.boxes.ids[number] if is_truth else None,
                score=None if is_truth else float(cloud.detections.scores[number]),
                **box,
                points=int(points[number]),
                occlusion=_none_if_undefined(truth.occlusion[number]) if is_truth else None,
                **{name: values[number] for name, values in outcomes[kind].items()},
                is_lost=bool(lost[number]) if is_truth else None,
                is_displaced=bool(displaced[number]) if is_truth else None,
                is_emptied=bool(emptied[number]) if is_truth else None,
                is_new=None if is_truth else bool(new[number]),
            )


def _outcomes(frame: FrameResult, cloud: CloudResult) -> dict[str, dict[str, list[Any]]]:
    """The outcome and the match of every box, by its kind (detection or object), then by field."""
    truth_labels, labels = frame.truth.boxes.labels, cloud.detections.labels
    outcomes: dict[str, dict[str, list[Any]]] = {DETECTION: {}, TRUTH: {}}
    for kind, count in ((DETECTION, len(labels)), (TRUTH, len(truth_labels))):
        for criterion in CRITERIA:
            outcomes[kind][f"fate_{criterion}"] = [IGNORED] * count  # classes that the detector does not know
            outcomes[kind][f"match_{criterion}"] = [None] * count
    for (criterion, name), matches in cloud.matches.items():
        truths = np.flatnonzero(labelled(truth_labels, name))
        detections = np.flatnonzero(labelled(labels, name))
        outcome, match = f"fate_{criterion}", f"match_{criterion}"
        for k, finds in enumerate(matches.finds):
            number = detections[k]
            outcomes[DETECTION][outcome][number] = (
                FOUND if matches.is_true_positive[k] else IGNORED if matches.is_ignored[k] else FALSE
            )
            outcomes[DETECTION][match][number] = int(truths[finds]) if finds >= 0 else None
        for m, found_by in enumerate(matches.found_by):
            number = truths[m]
            if matches.is_evaluated[m]:
                outcomes[TRUTH][outcome][number] = FOUND if found_by >= 0 else MISSED
            outcomes[TRUTH][match][number] = int(detections[found_by]) if found_by >= 0 else None
    return outcomes


def _none_if_undefined(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
