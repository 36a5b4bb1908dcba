"""Objects that an attack hides or displaces and false positives that it causes, by class and range."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.pipeline.results.records import SuccessRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.condition_matches import WHOLE
from advpipe.stages.evaluate.detection.frame_row import (
    displaced_objects,
    lost_objects,
    new_false_positives,
)
from advpipe.stages.evaluate.detection.metrics import above_0, ratio
from advpipe.stages.evaluate.detection.scored import Scored
from advpipe.stages.evaluate.detection.scoring import found_objects, labelled
from advpipe.stages.evaluate.detection.strata import STRATA, Stratum, box_range_m

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

EVERYWHERE = Stratum("", WHOLE, 0.0, float("inf"))
RANGES = (EVERYWHERE, *(stratum for stratum in STRATA if stratum.by == "range"))
EVERY_CLASS = "all"


@dataclass(frozen=True)
class FrameOutcome:
    """What became of the M objects of a frame in one of its clouds, and the K detections there.

    found, lost, displaced: (M,), at loose overlap unless strictly. new: (K,), false positives.
    """

    object_labels: Int64
    object_ranges_m: Float64
    detection_labels: Int64
    detection_ranges_m: Float64
    found: Bool
    lost: Bool
    new: Bool
    strictly_found: Bool
    strictly_lost: Bool
    displaced: Bool

    @classmethod
    def of(cls, frame: FrameResult, condition: str, min_score: float) -> FrameOutcome:
        cloud, truth, clean = frame.clouds()[condition], frame.truth, frame.clean
        return cls(
            object_labels=truth.boxes.labels,
            object_ranges_m=box_range_m(truth.boxes.geometry),
            detection_labels=cloud.detections.labels,
            detection_ranges_m=box_range_m(cloud.detections.boxes),
            found=found_objects(truth, clean.matches, min_score),
            lost=lost_objects(truth, clean, cloud, min_score),
            new=new_false_positives(clean, cloud, min_score),
            strictly_found=found_objects(truth, clean.matches, min_score, "strict"),
            strictly_lost=lost_objects(truth, clean, cloud, min_score, "strict"),
            displaced=displaced_objects(truth, clean, cloud, min_score),
        )

    def counts(self, name: str, stratum: Stratum) -> tuple[int, ...]:
        """Of a class or of every one, in a range, in the order of the columns of `_record`."""
        objects = stratum.holds(self.object_ranges_m)
        detections = stratum.holds(self.detection_ranges_m)
        if name != EVERY_CLASS:
            objects &= labelled(self.object_labels, name)
            detections &= labelled(self.detection_labels, name)
        return (
            int((self.found & objects).sum()),
            int((self.lost & objects).sum()),
            int((self.new & detections).sum()),
            int((self.strictly_found & objects).sum()),
            int((self.strictly_lost & objects).sum()),
            int((self.displaced & objects).sum()),
        )


def success_records(scored: Scored, result: ResultRow, conditions: Sequence[str]) -> Iterator[SuccessRecord]:
    """A record for each condition, class and range: objects found on clean clouds and lost on these.

    lost of found in percent has its interval from the bootstrap. new_false_positives count by their own
    class and range.
    """
    for condition in conditions:
        outcomes = [FrameOutcome.of(frame, condition, scored.min_score) for frame in scored.comparison.frames]
        for name in (EVERY_CLASS, *scored.classes):
            for stratum in RANGES:
                yield _record(scored, result, outcomes, condition, name, stratum)


def _record(
    scored: Scored,
    result: ResultRow,
    outcomes: Sequence[FrameOutcome],
    condition: str,
    name: str,
    stratum: Stratum,
) -> SuccessRecord:
    bootstrap = scored.bootstrap
    counts = np.array([outcome.counts(name, stratum) for outcome in outcomes])
    # (F, 6): found, lost and new at loose overlap, found and lost at strict overlap, displaced
    found, lost, new, strictly_found, strictly_lost, displaced = (int(count) for count in counts.sum(axis=0))
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
        strict_attack_success_ci95=percentile_interval(share_draws(counts[:, 3:5], bootstrap)),
        displaced=displaced,
        new_false_positives=new,
    )


def share_draws(counts: Int64, bootstrap: BlockBootstrap) -> npt.NDArray[np.float64]:
    """A part in percent of a whole in each draw; counts: (F, 2), the whole and the part in each frame."""
    whole, part = (
        np.bincount(bootstrap.block, counts[:, column], minlength=bootstrap.n_blocks) for column in (0, 1)
    )
    return bootstrap.samples(lambda times: 100 * (times @ part) / above_0((times @ whole).astype(np.float64)))
