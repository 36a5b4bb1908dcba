"""A frame as a bird's-eye picture needs it: clouds, boxes, and what the attack changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.cloud_difference import CloudDifference, cloud_difference
from advpipe.pipeline.results.records import TransferRecord
from advpipe.pipeline.results.row import AttackRecord
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.frame_row import displaced_objects, lost_objects
from advpipe.stages.evaluate.detection.scoring import Truth, false_positives, found_objects
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.outcomes import best_box, best_detections

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

APART_NS = 1_000_000_000


@dataclass(frozen=True)
class CloudView:
    """One cloud and the boxes (K, 7) that the detector sees in it."""

    cloud: Cloud
    predictions: Float64


@dataclass(frozen=True)
class ReportScene:
    """One frame before and after an attack; `after` and `change` are None for a clean bag alone.

    lost: (M,) of the objects in `truth`, at loose overlap; on a clean bag alone, those that are missed.
    displaced: (M,), found at loose overlap only; None on a clean bag alone. marks: by the number of a lost or
    displaced object, score and IoU of the best box that the detector has of it after the attack.
    min_score: from which on a box counts.
    """

    title: str
    name: str
    truth: Truth
    lost: Bool
    before: CloudView
    after: CloudView | None
    change: CloudDifference | None
    displaced: Bool | None = None
    marks: Mapping[int, str] = field(default_factory=dict)
    min_score: float = 0.0


def worst_frames(summary: Summary, count: int) -> list[FrameResult]:
    """The frames with most lost objects, or on a clean bag with most errors, worst first."""
    frames = summary.comparison.frames
    return _apart(sorted(frames, key=lambda f: (-_damage(f, summary.min_score), f.index)), count)


def best_frames(summary: Summary, count: int, but: Sequence[FrameResult]) -> list[FrameResult]:
    """The frames with the least share of lost objects or errors, among equals the fullest, best first.

    but: frames that are shown already, and their neighbours, are not taken.
    """
    candidates = []
    for frame in summary.comparison.frames:
        found = int(found_objects(frame.clean.matches, summary.min_score).sum())
        if found:
            damage = _damage(frame, summary.min_score)
            candidates.append((damage / (found + damage), -found, frame.index, frame))
    order = [frame for *_, frame in sorted(candidates, key=lambda each: each[:3])]
    return _apart(order, count, but)


def _apart(order: Sequence[FrameResult], count: int, but: Sequence[FrameResult] = ()) -> list[FrameResult]:
    """The first ones that are at least 1 s apart."""
    chosen: list[FrameResult] = []
    for frame in order:
        shown = [*but, *chosen]
        if len(chosen) < count and all(abs(frame.stamp_ns - c.stamp_ns) >= APART_NS for c in shown):
            chosen.append(frame)
    return chosen


def _damage(frame: FrameResult, min_score: float) -> int:
    """Lost objects; on a clean bag alone, missed objects and false positives."""
    damage = int(_lost(frame, min_score).sum())
    if frame.adversarial is None:
        damage += _wrong(frame.clean, min_score)
    return damage


def _wrong(cloud: CloudResult, min_score: float) -> int:
    return int(false_positives(cloud.matches, min_score).sum())


def load_scene(
    clean: Path, summary: Summary, frame: FrameResult, lidar_topic: str | None = None
) -> ReportScene:
    """A frame of a comparison, with its clouds read again."""
    bag, lost = summary.comparison.bag, _lost(frame, summary.min_score)
    before = CloudView(
        _cloud(clean, frame.index, lidar_topic),
        _seen(frame.clean.detections.boxes, frame.clean.detections.scores, summary),
    )
    name = f"{summary.comparison.name}-{frame.index:06d}"
    if bag is None or frame.adversarial is None:
        objects, wrong = int(frame.truth.is_evaluated.sum()), _wrong(frame.clean, summary.min_score)
        missed = f"{int(lost.sum())} of {objects} objects missed"
        title = f"frame {frame.index}: {missed}, {wrong} false positive{'' if wrong == 1 else 's'}"
        return ReportScene(title, name, frame.truth, lost, before, None, None, min_score=summary.min_score)
    found = int(found_objects(frame.clean.matches, summary.min_score).sum())
    seen = frame.adversarial.detections
    displaced = displaced_objects(frame.clean, frame.adversarial, summary.min_score)
    after = CloudView(
        _cloud(bag, frame.adversarial_index, lidar_topic), _seen(seen.boxes, seen.scores, summary)
    )
    return ReportScene(
        f"{attack_title(summary.result.attack)}, frame {frame.index}: "
        f"{int(lost.sum())} of {found} found objects lost, {int(displaced.sum())} displaced",
        name,
        frame.truth,
        lost,
        before,
        after,
        cloud_difference(before.cloud, after.cloud),
        displaced,
        _marks(frame.truth, frame.adversarial, lost | displaced),
        summary.min_score,
    )


def _marks(truth: Truth, cloud: CloudResult, chosen: Bool) -> dict[int, str]:
    """Such as `0.42, IoU 0.58`, of each chosen object."""
    best, iou = best_detections(truth, cloud)
    marks = {}
    for number in np.flatnonzero(chosen).tolist():
        score, overlap = best_box(cloud, int(best[number]), float(iou[number]))
        marks[number] = f"{score}, IoU {overlap}" if best[number] >= 0 else score
    return marks


def attack_name(made_by: AttackRecord | TransferRecord) -> str:
    """Such as `detach, recipe best`."""
    return f"{made_by.attack}, recipe {made_by.recipe}" if made_by.recipe else made_by.attack


def attack_title(made_by: AttackRecord | TransferRecord) -> str:
    """Such as `detach, recipe best, ratio 0.01`."""
    budget = f", {made_by.parameter} {made_by.value}" if made_by.parameter else ""
    return ", ".join([attack_name(made_by) + budget, *variations(made_by)])


def variations(made_by: AttackRecord | TransferRecord) -> list[str]:
    """Parameters beside recipe and budget that change what an attack is; empty at their defaults."""
    given = made_by.parameters
    texts = {
        "truth by detections": given.get("truth") == "detections",
        "goal hide": given.get("goal") == "hide" and made_by.recipe != "hide",
        "along rays": bool(given.get("along_ray")),
        "in occlusion order": bool(given.get("keep_occlusion_order")),
        f"λ = {given.get('weight')}": made_by.recipe == "paper" and bool(given.get("weight")),
    }
    return [text for text, holds in texts.items() if holds]


def _lost(frame: FrameResult, min_score: float) -> Bool:
    if frame.adversarial is None:
        return frame.truth.is_evaluated & ~found_objects(frame.clean.matches, min_score)
    return lost_objects(frame.clean, frame.adversarial, min_score)


def _seen(boxes: Float64, scores: Float64, summary: Summary) -> Float64:
    return boxes[scores >= summary.min_score]


def _cloud(bag: Path, index: int, lidar_topic: str | None) -> Cloud:
    frame = next(iter(read_frames(bag, FrameSlice(index, index + 1), lidar_topic=lidar_topic)))
    return frame.cloud


def crop(boxes: Sequence[Float64], margin_m: float, least_m: float) -> tuple[float, float, float, float]:
    """Limits x_min, x_max, y_min, y_max around box centres and the sensor, at least `least_m` wide."""
    centres = np.concatenate([np.zeros((1, 2)), *[b[:, :2] for b in boxes]])
    low, high = centres.min(axis=0) - margin_m, centres.max(axis=0) + margin_m
    middle, half = (low + high) / 2, np.maximum(high - low, least_m) / 2
    (x_min, y_min), (x_max, y_max) = middle - half, middle + half
    return float(x_min), float(x_max), float(y_min), float(y_max)
