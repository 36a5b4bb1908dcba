"""The temporal attack check of an evaluation, on the frames that stand in runs of consecutive clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.attack_detection.temporal import temporal_scores
from advpipe.pipeline.detector.protocol import Detections
from advpipe.stages.evaluate.detection.attack_checks import MIN_SCORE
from advpipe.stages.evaluate.detection.checked_cloud import CheckedCloud, CheckedFrame
from advpipe.stages.evaluate.detection.comparison import FrameResult

NO_DETECTIONS = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))


def checked_sequence(frames: Sequence[FrameResult]) -> list[CheckedFrame]:
    """Each frame whose two predecessors are known; none where no run of consecutive clouds is long enough.

    Clean clouds are judged by the clean ones before them, attacked ones by the adversarial bag's: a vehicle
    under attack sees nothing else.
    """
    stamps_ns = [frame.stamp_ns for frame in frames]
    clean = temporal_scores(stamps_ns, [frame.clean.detections for frame in frames], MIN_SCORE)
    attacked = temporal_scores(
        stamps_ns,
        [frame.adversarial.detections if frame.adversarial else NO_DETECTIONS for frame in frames],
        MIN_SCORE,
    )
    return [
        CheckedFrame(
            CheckedCloud(float(quiet)),
            CheckedCloud(float(loud)) if frame.is_attacked else None,
        )
        for frame, quiet, loud in zip(frames, clean, attacked, strict=True)
        if np.isfinite(quiet)
    ]
