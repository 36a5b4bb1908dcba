"""The attack checks of an evaluation: they learn from clean clouds of the drive, and judge each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.attack_detection.base import AttackCheck, CheckNotApplicableError, DefenderKnowledge
from advpipe.pipeline.attack_detection.registry import parse_attack_checks
from advpipe.pipeline.bag.frames import FrameSlice, count_frames, read_clouds
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, VoxelDetector
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference
from advpipe.stages.evaluate.detection.checked_cloud import CheckedCloud
from advpipe.stages.evaluate.detection.scoring import CachedDetector, new_boxes
from advpipe.stages.evaluate.options import Options

CALIBRATION_CLOUDS = 8
"""Clean clouds, spread over the drive, from which the checks learn the sensor."""

MIN_SCORE = 0.3
"""Detections below this score are not judged: a vehicle would not act on them."""


@dataclass(frozen=True)
class AttackChecks:
    """The checks by name, and why others cannot run on this drive."""

    checks: Mapping[str, AttackCheck]
    not_run: Mapping[str, str]

    @classmethod
    def learnt(
        cls, options: Options, clean: Path, detector: ObjectDetector, scored: CachedDetector
    ) -> AttackChecks:
        """The chosen checks. detector: before it is adapted to the clouds; scored: as it is scored."""
        chosen = parse_attack_checks(options.detect_attacks)
        if not chosen:
            return cls({}, {})
        count = count_frames(clean, options.lidar_topic)
        step = max(1, count // CALIBRATION_CLOUDS)
        spread = FrameSlice(min(step // 2, count - 1), count, step)
        clouds = [scan.cloud for _, scan, _ in read_clouds(clean, spread, lidar_topic=options.lidar_topic)]
        known, _ = detector_for_cloud(detector, options.adaptation, xyz(clouds[0]), detector)
        grid = known.voxel_grid if isinstance(known, VoxelDetector) else None
        knowledge = DefenderKnowledge(clouds, grid, lambda cloud: _sure(scored.detect(cloud)))
        checks, not_run = {}, {}
        for name, make in chosen.items():
            try:
                checks[name] = make(knowledge)
            except CheckNotApplicableError as error:
                not_run[name] = str(error)
        return cls(checks, not_run)

    def on_clean(self, cloud: Cloud, detections: Detections) -> dict[str, CheckedCloud]:
        """The checks of a clean cloud with the detections in it."""
        sure = _sure(detections)
        every = np.ones(len(sure), bool)
        none = np.zeros(0, np.int64)
        return {name: CheckedCloud.of(check(cloud, sure), none, every) for name, check in self.checks.items()}

    def on_attacked(
        self, cloud: Cloud, change: CloudDifference, detections: Detections, clean: Detections
    ) -> dict[str, CheckedCloud]:
        """The checks of an attacked cloud; clean: the detections in the clean one."""
        sure, touched = _sure(detections), np.concatenate([change.moved, change.added])
        new = new_boxes(sure, clean, MIN_SCORE)
        return {
            name: CheckedCloud.of(check(cloud, sure), touched, new) for name, check in self.checks.items()
        }


def _sure(detections: Detections) -> Detections:
    kept = np.flatnonzero(detections.scores >= MIN_SCORE)
    return Detections(detections.boxes[kept], detections.scores[kept], detections.labels[kept])
