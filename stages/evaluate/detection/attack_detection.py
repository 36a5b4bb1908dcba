"""How well checks tell attacked clouds from clean ones: true and false positive rates at a threshold that is
calibrated on other clean clouds of the drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.threshold import area_under_roc, calibrated_threshold
from advpipe.pipeline.results.records import AttackDetectionRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.checked_cloud import CheckedCloud, CheckedFrame
from advpipe.stages.evaluate.detection.checked_sequence import checked_sequence
from advpipe.stages.evaluate.detection.scored import Scored

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

FALSE_POSITIVE_RATE = 0.01
"""Of clean clouds: what thresholds are calibrated to."""


def attack_detection_records(scored: Scored, result: ResultRow) -> Iterator[AttackDetectionRecord]:
    """A record for each check that ran on all frames; none without an attack."""
    frames = scored.comparison.frames
    if "adv" not in scored.by_condition or not frames:
        return
    for check in frames[0].attack_checks:
        yield _record(check, [frame.attack_checks[check] for frame in frames], result)
    for check in scored.comparison.sequence_checks:
        if judged := checked_sequence(frames):
            yield _record(check, judged, result)


def _record(check: str, frames: Sequence[CheckedFrame], result: ResultRow) -> AttackDetectionRecord:
    clean = [frame.clean for frame in frames]
    thresholds, calibration = cross_thresholds(np.array([each.score for each in clean]))
    attacked = [
        (frame.attacked, limit)
        for frame, limit in zip(frames, thresholds, strict=True)
        if frame.attacked is not None
    ]
    clean_scores = np.array([each.score for each in clean])
    touched = sum(each.touched for each, _ in attacked)
    new, new_above = _above(attacked)
    known, known_above = _above(list(zip(clean, thresholds, strict=True)))
    expected = max(FALSE_POSITIVE_RATE, 1 / (calibration + 1)) if calibration else np.nan
    return AttackDetectionRecord(
        *result.identity,
        check=check,
        frames=len(frames),
        attacked_frames=len(attacked),
        calibration_frames=calibration,
        expected_false_positive_percent=100 * expected,
        true_positive_percent=_percent(sum(e.score > limit for e, limit in attacked), len(attacked)),
        false_positive_percent=_percent(int((clean_scores > thresholds).sum()), len(frames)),
        auc=area_under_roc(clean_scores, np.array([each.score for each, _ in attacked])),
        points_true_positive_percent=_percent(sum(each.touched_flagged for each, _ in attacked), touched),
        points_false_positive_percent=_percent(
            sum(each.flagged for each in clean), sum(each.points for each in clean)
        ),
        new_detections=new,
        new_detections_true_positive_percent=_percent(new_above, new),
        detections_false_positive_percent=_percent(known_above, known),
        new_detections_called_fake_percent=_called_fake([each for each, _ in attacked]),
        detections_called_fake_percent=_called_fake(clean),
    )


def cross_thresholds(scores: Float64) -> tuple[Float64, int]:
    """A threshold for each clean cloud (N,), in time order, and how many clouds it is calibrated on at least.

    The first half is judged by what the second half shows, and the other way round: neighbouring clouds are
    alike, so none is judged by its neighbours. A single cloud has a threshold that nothing exceeds.
    """
    half = (len(scores) + 1) // 2
    first, second = (
        calibrated_threshold(part, FALSE_POSITIVE_RATE) for part in (scores[:half], scores[half:])
    )
    return np.where(np.arange(len(scores)) < half, second, first), len(scores) - half


def _above(judged: Sequence[tuple[CheckedCloud, float]]) -> tuple[int, int]:
    """How many detections were judged, and how many of them are above the threshold of their cloud."""
    found = [(each.detections, limit) for each, limit in judged if each.detections is not None]
    above = sum(int((scores > limit).sum()) for scores, limit in found)
    return sum(len(scores) for scores, _ in found), above


def _called_fake(judged: Sequence[CheckedCloud]) -> float:
    """The share of the detections that a check takes for spoofed by limits of its own, in percent."""
    decided = [each for each in judged if each.fake is not None and each.detections is not None]
    whole = sum(len(each.detections) for each in decided if each.detections is not None)
    return _percent(sum(each.fake or 0 for each in decided), whole)


def _percent(part: int, whole: int) -> float:
    return 100 * part / whole if whole else np.nan
