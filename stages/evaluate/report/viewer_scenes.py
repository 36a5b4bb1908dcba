"""Frames of a comparison for the viewer: what became of each object, with scores and overlaps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, count_points
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.viewer.map_lines import lane_lines, read_lanes
from advpipe.pipeline.viewer.poses import lidar_SE3_map
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
    TRUTH,
    Fact,
    SceneBox,
    ViewerScene,
    object_title,
    outcome_lead,
    prediction_box,
)
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.matches import labelled
from advpipe.stages.evaluate.detection.scoring import (
    Bool,
    Truth,
    false_positives,
    found_objects,
)
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.outcomes import best_box, best_detections
from advpipe.stages.evaluate.report.scene import (
    ReportScene,
    attack_title,
    best_frames,
    load_scene,
    worst_frames,
)

WORST, BEST = 2, 1
"""Frames of the strongest attack that a report shows in 3D: with most lost objects, and with fewest."""

MOST = 6
"""Frames in all; of the other attacks the worst one each."""


def viewer_scenes(
    clean: Path, summaries: Sequence[Summary], lidar_topic: str | None = None
) -> list[ViewerScene]:
    """The worst frame of the strongest attack, two others, and the worst ones of other attacks.

    The strongest attack has the lowest mAP ratio. Without attacks, they are frames of the clean bag; where
    no detector saw clouds, there are none.
    """
    if not summaries:
        return []
    order = sorted(summaries, key=_map_ratio)
    chosen = [(summary, frame) for summary in order[:1] for frame in worst_frames(summary, WORST)]
    worst = [frame for _, frame in chosen]
    chosen += [(summary, frame) for summary in order[:1] for frame in best_frames(summary, BEST, worst)]
    chosen += [(summary, frame) for summary in order[1:] for frame in worst_frames(summary, 1)]
    reader = BagReader(clean)
    lanes, topic = read_lanes(reader), find_lidar_topic(reader, lidar_topic)
    scenes = []
    for summary, frame in chosen[:MOST]:
        time_ns = int(reader.log_times_ns(topic)[frame.index])
        place = lidar_SE3_map(reader, topic, time_ns) if lanes else None
        scene = _viewer_scene(summary, frame, load_scene(clean, summary, frame, lidar_topic), len(order) > 1)
        scenes.append(scene if place is None else replace(scene, lines=tuple(lane_lines(lanes, place))))
    return scenes


def _map_ratio(summary: Summary) -> float:
    attacked = summary.result.attacked
    return (
        float("inf") if attacked is None or attacked.map_ratio_percent is None else attacked.map_ratio_percent
    )


def _viewer_scene(
    summary: Summary, frame: FrameResult, scene: ReportScene, is_one_of_several: bool
) -> ViewerScene:
    outcomes = object_outcomes(frame, summary.min_score)
    counts = {outcome: outcomes.count(outcome) for outcome in (LOST, DISPLACED, MISSED)}
    counted = (
        ", ".join(f"{count} {outcome}" for outcome, count in counts.items() if count) or "every object found"
    )
    name = f"{attack_title(summary.result.attack)}, " if scene.after else ""
    return ViewerScene(
        name=scene.name,
        title=f"{name}frame {frame.index}: {counted}",
        label=f"{summary.comparison.name} {frame.index}: {counted}"
        if is_one_of_several
        else f"{frame.index}: {counted}",
        clean=scene.before.cloud,
        attacked=scene.after.cloud if scene.after else None,
        change=scene.change,
        boxes=(*_objects(summary, frame, scene, outcomes), *_predictions(summary, frame)),
        note=f"Predictions with a score of at least {summary.min_score:.2f}.",
    )


def object_outcomes(frame: FrameResult, min_score: float) -> list[str]:
    """What became of each object of a frame, of detections with at least this score."""
    on = [frame.clean, *([frame.adversarial] if frame.adversarial else [])]
    loose = [found_objects(cloud.matches, min_score) for cloud in on]
    strict = [found_objects(cloud.matches, min_score, "strict") for cloud in on]
    outcomes = np.full(len(frame.truth.boxes), FOUND, dtype=object)
    outcomes[strict[0] & ~strict[-1]] = DISPLACED
    outcomes[loose[0] & ~loose[-1]] = LOST
    outcomes[~loose[0]] = MISSED
    outcomes[~frame.truth.is_evaluated] = IGNORED
    return [str(outcome) for outcome in outcomes]


def _objects(
    summary: Summary, frame: FrameResult, scene: ReportScene, outcomes: Sequence[str]
) -> Iterator[SceneBox]:
    truth, boxes = frame.truth, frame.truth.boxes
    after = count_points(xyz(scene.after.cloud), boxes.geometry) if scene.after else None
    found_by = [
        (cloud, *best_detections(truth, cloud))
        for cloud in (frame.clean, frame.adversarial)
        if cloud is not None
    ]
    for number, (box, outcome) in enumerate(zip(boxes.geometry, outcomes, strict=True)):
        points = [str(truth.points[number]), *([] if after is None else [str(after[number])])]
        found = [best_box(cloud, int(best[number]), float(iou[number])) for cloud, best, iou in found_by]
        scores, overlaps = zip(*found, strict=True)
        yield SceneBox(
            TRUTH,
            box.tolist(),
            object_title(CLASSES[boxes.labels[number]], boxes.ids[number]),
            outcome,
            ALWAYS,
            boxes.ids[number],
            lead=_lead(outcome, truth, number, summary.min_score),
            facts=(
                Fact("range", f"{np.hypot(box[0], box[1]):.1f} m"),
                Fact("LiDAR points", *points),
                Fact("score", *scores),
                Fact("IoU in 3D", *overlaps),
                *_occlusion(truth.occlusion[number]),
                Fact("size", " × ".join(f"{length_m:.1f}" for length_m in box[3:6]) + " m"),
            ),
        )


def _lead(outcome: str, truth: Truth, number: int, min_score: float) -> str:
    if outcome == IGNORED:
        few = truth.points[number] < MIN_POINTS
        return "Not evaluated: " + (
            f"fewer than {MIN_POINTS} points in the clean cloud."
            if few
            else "out of range, or of another class."
        )
    return outcome_lead(outcome, min_score)


def _occlusion(share: float) -> Iterator[Fact]:
    if np.isfinite(share):
        yield Fact("occlusion", f"{100 * share:.0f} %")


def _predictions(summary: Summary, frame: FrameResult) -> Iterator[SceneBox]:
    clouds = [(CLEAN if frame.adversarial else ALWAYS, frame.clean)]
    if frame.adversarial:
        clouds.append((ATTACKED, frame.adversarial))
    for condition, cloud in clouds:
        outcomes = _prediction_outcomes(cloud, summary.min_score)
        for number in np.flatnonzero(cloud.detections.scores >= summary.min_score).tolist():
            box, label = cloud.detections.boxes[number], cloud.detections.labels[number]
            yield prediction_box(
                box.tolist(),
                CLASSES[label],
                cloud.detections.scores[number],
                cloud.box_points[number],
                outcome=outcomes[number],
                condition=condition,
            )


def _prediction_outcomes(cloud: CloudResult, min_score: float) -> list[str]:
    wrong: Bool = false_positives(cloud.matches, min_score)
    ignored = np.zeros(len(wrong), dtype=bool)
    for (criterion, name), matches in cloud.matches.items():
        if criterion == "loose":
            ignored[labelled(cloud.detections.labels, name)] = matches.is_ignored
    return [
        FALSE if bad else IGNORED if left_out else HIT for bad, left_out in zip(wrong, ignored, strict=True)
    ]
