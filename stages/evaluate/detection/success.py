"""Objects that an attack hides or displaces and false positives that it causes, by class and range."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.pipeline.results.records import SuccessRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.condition_matches import WHOLE
from advpipe.stages.evaluate.detection.frame_row import (
    displaced_objects,
    lost_objects,
    new_false_positives,
)
from advpipe.stages.evaluate.detection.matches import labelled
from advpipe.stages.evaluate.detection.metrics import above_0, ratio
from advpipe.stages.evaluate.detection.scored import Scored
from advpipe.stages.evaluate.detection.scoring import found_objects
from advpipe.stages.evaluate.detection.strata import STRATA, Stratum, box_range_m

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

EVERYWHERE = Stratum("", WHOLE, 0.0, float("inf"))
RANGES = (EVERYWHERE, *(stratum for stratum in STRATA if stratum.by == "range"))
EVERY_CLASS = "all"


@dataclass(frozen=True)
class Outcomes:
    """What became of the M objects of F frames in one of the clouds of each, and the K detections there.

    object_frame, detection_frame: (M,) and (K,), which of the frames. objects: (M, 5), whether each object is
    found on the clean cloud, lost, found strictly, lost strictly, displaced. new: (K,), false positives.
    """

    frames: int
    object_frame: Int64
    object_labels: Int64
    object_ranges_m: Float64
    objects: Bool
    detection_frame: Int64
    detection_labels: Int64
    detection_ranges_m: Float64
    new: Bool

    @classmethod
    def of(cls, frames: Sequence[FrameResult], condition: str, min_score: float) -> Outcomes:
        """The outcomes in the clouds of a condition; there is at least one frame."""
        truths = [frame.truth.boxes for frame in frames]
        clouds = [frame.clouds()[condition] for frame in frames]
        both = [(frame.clean, cloud) for frame, cloud in zip(frames, clouds, strict=True)]
        return cls(
            len(frames),
            np.repeat(np.arange(len(frames)), [len(each) for each in truths]),
            np.concatenate([each.labels for each in truths]),
            np.concatenate([box_range_m(each.geometry) for each in truths]),
            np.concatenate([_of_objects(clean, cloud, min_score) for clean, cloud in both]),
            np.repeat(np.arange(len(frames)), [len(each.detections) for each in clouds]),
            np.concatenate([each.detections.labels for each in clouds]),
            np.concatenate([box_range_m(each.detections.boxes) for each in clouds]),
            np.concatenate([new_false_positives(clean, cloud, min_score) for clean, cloud in both]),
        )

    def counts(self, name: str, stratum: Stratum) -> Int64:
        """Of a class or of every one, in a range: (F, 6), the columns of `objects`, then the new."""
        objects, detections = stratum.holds(self.object_ranges_m), stratum.holds(self.detection_ranges_m)
        if name != EVERY_CLASS:
            objects &= labelled(self.object_labels, name)
            detections &= labelled(self.detection_labels, name)
        of_objects = [
            np.bincount(self.object_frame[objects & outcome], minlength=self.frames)
            for outcome in self.objects.T
        ]
        of_detections = np.bincount(self.detection_frame[detections & self.new], minlength=self.frames)
        return np.stack([*of_objects, of_detections], axis=1)


def _of_objects(clean: CloudResult, cloud: CloudResult, min_score: float) -> Bool:
    """The columns (M, 5) of `Outcomes.objects` of one frame."""
    return np.stack(
        [
            found_objects(clean.matches, min_score),
            lost_objects(clean, cloud, min_score),
            found_objects(clean.matches, min_score, "strict"),
            lost_objects(clean, cloud, min_score, "strict"),
            displaced_objects(clean, cloud, min_score),
        ],
        axis=1,
    )


def success_records(scored: Scored, result: ResultRow, conditions: Sequence[str]) -> Iterator[SuccessRecord]:
    """A record for each condition, class and range: objects found on clean clouds and lost on these.

    lost of found in percent has its interval from the bootstrap. new_false_positives count by their own
    class and range.
    """
    for condition in conditions:
        outcomes = Outcomes.of(scored.comparison.frames, condition, scored.min_score)
        for name in (EVERY_CLASS, *scored.classes):
            for stratum in RANGES:
                yield _record(scored, result, outcomes, condition, name, stratum)


def _record(
    scored: Scored,
    result: ResultRow,
    outcomes: Outcomes,
    condition: str,
    name: str,
    stratum: Stratum,
) -> SuccessRecord:
    bootstrap = scored.bootstrap
    counts = outcomes.counts(name, stratum)
    found, lost, strictly_found, strictly_lost, displaced, new = (int(count) for count in counts.sum(axis=0))
    return SuccessRecord(
        *result.identity,
        condition=condition,
        class_name=name,
        range=stratum.name,
        min_score=scored.min_score,
        found_clean=found,
        lost=lost,
        attack_success_percent=100 * ratio(lost, found),
        attack_success_ci95=percentile_interval(share_draws(counts[:, :2], bootstrap)),
        strict_found_clean=strictly_found,
        strict_lost=strictly_lost,
        strict_attack_success_percent=100 * ratio(strictly_lost, strictly_found),
        strict_attack_success_ci95=percentile_interval(share_draws(counts[:, 2:4], bootstrap)),
        displaced=displaced,
        new_false_positives=new,
    )


def share_draws(counts: Int64, bootstrap: BlockBootstrap) -> npt.NDArray[np.float64]:
    """A part in percent of a whole in each draw; counts: (F, 2), the whole and the part in each frame."""
    whole, part = (
        np.bincount(bootstrap.block, counts[:, column], minlength=bootstrap.n_blocks) for column in (0, 1)
    )
    return bootstrap.samples(lambda times: 100 * (times @ part) / above_0((times @ whole).astype(np.float64)))
