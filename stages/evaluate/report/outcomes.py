"""What became of objects that an attack displaces or hides: which boxes the detector still has of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.frame_row import displaced_objects, lost_objects
from advpipe.stages.evaluate.detection.matches import labelled
from advpipe.stages.evaluate.detection.scoring import Bool, Int64, Truth
from advpipe.stages.evaluate.report.numbers import NOTHING
from advpipe.stages.evaluate.report.section import Table

Float64 = npt.NDArray[np.float64]

OVERLAPS = 0.05
"""From this IoU on, a detection of its class belongs to an object's story."""

HEADS = (
    *("object", "outcome", "frame", "class", "range m", "LiDAR points"),
    *("score, clean", "score, attacked", "IoU, clean", "IoU, attacked"),
)


def best_detections(truth: Truth, cloud: CloudResult) -> tuple[Int64, Float64]:
    """For each object (M,) the detection that finds it or, of its class, overlaps it most, and their 3D IoU.

    The detection is -1 where none overlaps it by `OVERLAPS`, whatever the scores.
    """
    overlap = iou_3d(truth.boxes.geometry, cloud.detections.boxes)
    overlap[truth.boxes.labels[:, None] != cloud.detections.labels] = 0.0
    best = np.full(len(truth.boxes), -1, dtype=np.int64)
    if overlap.shape[1]:
        best = np.where(overlap.max(axis=1) >= OVERLAPS, overlap.argmax(axis=1), -1)
    for (criterion, name), matches in cloud.matches.items():
        if criterion == "loose":
            objects = np.flatnonzero(labelled(truth.boxes.labels, name))
            detections = np.flatnonzero(labelled(cloud.detections.labels, name))
            hit = matches.found_by >= 0
            best[objects[hit]] = detections[matches.found_by[hit]]
    iou = np.zeros(len(best))
    iou[best >= 0] = overlap[best >= 0, best[best >= 0]]
    return best, iou


def best_box(cloud: CloudResult, detection: int, iou: float) -> tuple[str, str]:
    """Score and IoU of an object's best detection as texts."""
    if detection < 0:
        return "no box", NOTHING
    return f"{cloud.detections.scores[detection]:.2f}", f"{iou:.2f}"


def outcomes_table(frames: Sequence[FrameResult], min_score: float) -> Table:
    """The displaced and lost objects of some attacked frames, a line each."""
    lines = [line for frame in frames for line in _lines(frame, min_score)]
    return Table(
        "Displaced and lost objects in the worst frames",
        HEADS,
        tuple(lines),
        "Score and IoU in 3D: of the detection that finds the object or, of its class, overlaps it most; "
        f"detections count from a score of {min_score:.2f}.",
    )


def _lines(frame: FrameResult, min_score: float) -> list[tuple[str, ...]]:
    truth, adversarial = frame.truth, frame.adversarial
    if adversarial is None:
        return []
    outcomes: tuple[tuple[str, Bool], ...] = (
        ("lost", lost_objects(frame.clean, adversarial, min_score)),
        ("displaced", displaced_objects(frame.clean, adversarial, min_score)),
    )
    found_by = [(cloud, *best_detections(truth, cloud)) for cloud in (frame.clean, adversarial)]
    lines = []
    for outcome, is_of_it in outcomes:
        for number in np.flatnonzero(is_of_it).tolist():
            box = truth.boxes.geometry[number]
            scores, overlaps = zip(
                *(best_box(cloud, int(best[number]), float(iou[number])) for cloud, best, iou in found_by),
                strict=True,
            )
            lines.append(
                (
                    truth.boxes.ids[number],
                    outcome,
                    str(frame.index),
                    CLASSES[truth.boxes.labels[number]],
                    f"{np.hypot(box[0], box[1]):.1f}",
                    str(truth.points[number]),
                    *scores,
                    *overlaps,
                )
            )
    return lines
