"""One process of `attack_study.py`: attacks frames, several at once on a GPU, and measures what is left."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from attack_study_plan import CLEAN, Condition

from advpipe.pipeline.adversary.goal import goal_of
from advpipe.pipeline.attack_detection.base import AttackCheck, CheckNotApplicableError, DefenderKnowledge
from advpipe.pipeline.attack_detection.names import ALL
from advpipe.pipeline.attack_detection.registry import parse_attack_checks
from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.protocol import BatchDetector, Detections, ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.stages.attack.lidar.scan_placement import in_scan_order
from advpipe.stages.evaluate.detection.displacement import Displacement, finite_xyz
from advpipe.stages.evaluate.detection.point_traces import PointTraces
from advpipe.stages.evaluate.detection.scoring import CachedDetector, Truth, ground_truth, match

KINDS = ("strict", "loose")
MIN_SCORE = 0.3
"""Detections below are not judged by attack checks."""

CALIBRATION_CLOUDS = 8
"""Clean clouds that the attack checks learn from, evenly spread over the frames."""

UNDEFENDED = "none"

Row = dict[str, Any]


@dataclass
class Study:
    """The frames and the detector of one process. adaptation: how the detector is shown clouds; it does not
    level them."""

    frames: Sequence[Frame]
    detector: ObjectDetector
    adaptation: Adaptation = field(default_factory=Adaptation)
    _checks: dict[str, AttackCheck] = field(default_factory=dict)
    _is_learnt: bool = False

    def rows(self, condition: Condition, numbers: Sequence[int]) -> list[Row]:
        """Attack the frames of these numbers together, and measure them."""
        if condition.is_checked:
            self._learn()
        start_s, cpu_s = time.time(), time.process_time()
        chosen = [self.frames[number] for number in numbers]
        works = [lambda seen, frame=frame: self._row(condition, frame, seen) for frame in chosen]
        with condition.setting():
            if isinstance(self.detector, BatchDetector):
                found = run_batched(self.detector, works)
            else:
                found = [work(self.detector) for work in works]
        cost = {
            "cpu_s": round((time.process_time() - cpu_s) / len(numbers), 3),
            "wall_s": round((time.time() - start_s) / len(numbers), 3),
            "start": round(start_s, 2),
            "end": round(time.time(), 2),
        }
        return [
            {"condition": condition.key, "frame": n} | row | cost
            for n, row in zip(numbers, found, strict=True)
        ]

    def _placed(self, detector: ObjectDetector) -> ObjectDetector:
        """The detector, or what stands for it in a batch, as it is shown clouds."""
        nothing = np.zeros((0, 3), np.float32)
        return detector_for_cloud(detector, self.adaptation, nothing, self.detector)[0]

    def _row(self, condition: Condition, frame: Frame, detector: ObjectDetector) -> Row:
        detector = self._placed(detector)
        seen = CachedDetector(detector)
        truth = ground_truth(frame, seen.classes, seen.range_m)
        start_s, row = time.time(), {}
        cloud = frame.cloud
        if condition != CLEAN:
            rng = named_generator(condition.seed, "study", condition.budget, frame.index)
            result = condition.build()(frame.cloud, frame.boxes, detector, rng)
            result = in_scan_order(frame.cloud, result)
            cloud, row = result.cloud, _changes(frame.cloud, result.cloud, detector)
            row["note"] = result.note
        row["attack_s"] = round(time.time() - start_s, 3)
        found = seen.detect(cloud)
        row["objective"] = self._objective(condition, frame, detector, found)
        views = {UNDEFENDED: matched(truth, found, seen.classes)}
        if condition.is_defended:
            for name, defence in parse_defences(["default"]).items():
                rng = named_generator(condition.seed, "study", "defence", name, frame.index)
                defended = defence(cloud, rng)
                there = seen.detect(defended.cloud, defended.placement)
                views[name] = matched(truth, there, seen.classes)
        row["views"] = views
        if condition.is_checked:
            sure = _sure(found)
            row["found"] = np.column_stack(
                [found.boxes[:, :3].round(3), found.scores.round(4), found.labels]
            ).tolist()
            row["checks"] = {name: round(check(cloud, sure).score, 6) for name, check in self._checks.items()}
        return row

    def _objective(
        self, condition: Condition, frame: Frame, detector: ObjectDetector, found: Detections
    ) -> float:
        """The attacker's mean success on an object, higher is better, by the goal of `best`."""
        own = np.array([detector.classes.index(CLASSES[label]) for label in found.labels], np.int64)
        constraints = (
            (condition if condition != CLEAN else Condition("perturb-10", "best")).build().constraints
        )  # type: ignore[attr-defined]
        goal = goal_of(constraints, detector, frame.cloud, frame.boxes)
        success = goal.success(Detections(found.boxes, found.scores, own))
        return round(float(success.mean()), 5) if len(success) else 0.0

    def _learn(self) -> None:
        """Let the attack checks learn from clean clouds, once; those that cannot are left out."""
        if self._is_learnt:
            return
        self._is_learnt = True
        places = np.linspace(0, len(self.frames) - 1, min(CALIBRATION_CLOUDS, len(self.frames)))
        clouds = [self.frames[place].cloud for place in sorted(set(places.round().astype(int).tolist()))]
        detector = self._placed(self.detector)
        grid = detector.voxel_grid if isinstance(detector, VoxelDetector) else None
        seen = CachedDetector(detector)
        knowledge = DefenderKnowledge(clouds, grid, lambda cloud: _sure(seen.detect(cloud)))
        for name, make in parse_attack_checks([ALL]).items():
            try:
                self._checks[name] = make(knowledge)
            except CheckNotApplicableError:
                continue


def matched(truth: Truth, found: Detections, classes: tuple[str, ...]) -> Mapping[str, Any]:
    """By class: the number of objects; the detections' scores in units of 1e-5; and, strictly and loosely, 1
    for a true positive, 0 for a false one, - for one that does not count."""
    matches = match(truth, found, classes, KINDS)
    coded = {}
    for name in classes:
        first = matches["strict", name]
        signs = [
            "".join(
                "1" if hit else "-" if ignored else "0"
                for hit, ignored in zip(
                    matches[kind, name].is_true_positive, matches[kind, name].is_ignored, strict=True
                )
            )
            for kind in KINDS
        ]
        coded[name] = [first.n_truth, np.rint(1e5 * first.scores).astype(int).tolist(), *signs]
    return coded


def _changes(clean: Cloud, cloud: Cloud, detector: ObjectDetector) -> Row:
    """By how much a cloud differs from the clean one."""
    change = cloud_difference(clean, cloud)
    grid = detector.voxel_grid if isinstance(detector, VoxelDetector) else None
    moved, traces = Displacement.of(clean, cloud, change), PointTraces.of(clean, cloud, change, grid)
    is_changed = bool(len(change.removed) or len(change.added) or len(change.moved))
    return {
        "removed": len(change.removed),
        "added": len(change.added),
        "moved": moved.count,
        "rms_m": round(moved.rms_m, 5),
        "max_m": round(moved.max_m, 5),
        "off_ray": traces.off_ray,
        "in_grid": traces.in_grid,
        "at_face": traces.at_face,
        "chamfer_m2": float(f"{chamfer_distance(finite_xyz(clean), finite_xyz(cloud)):.4g}")
        if is_changed
        else 0.0,
    }


def _sure(found: Detections) -> Detections:
    kept = np.flatnonzero(found.scores >= MIN_SCORE)
    return Detections(found.boxes[kept], found.scores[kept], found.labels[kept])
