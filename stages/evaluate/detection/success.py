"""Objects that an attack hides or displaces and false positives that it causes, by class and range."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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

EVERYWHERE = Stratum("", WHOLE, 0.0, float("inf"))
RANGES = (EVERYWHERE, *(stratum for stratum in STRATA if stratum.by == "range"))
EVERY_CLASS = "all"


def success_records(scored: Scored, result: ResultRow, conditions: Sequence[str]) -> Iterator[SuccessRecord]:
    """A record for each condition, class and range: objects found on clean clouds and lost on these.

    lost of found in percent has its interval from the bootstrap. new_false_positives count by their own
    class and range.
    """
    for condition in conditions:
        for name in (EVERY_CLASS, *scored.classes):
            for stratum in RANGES:
                yield _record(scored, result, condition, name, stratum)


def _record(scored: Scored, result: ResultRow, condition: str, name: str, stratum: Stratum) -> SuccessRecord:
    frames, bootstrap = scored.comparison.frames, scored.bootstrap
    counts = np.array([_counts(frame, condition, name, stratum, scored.min_score) for frame in frames])
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


def _counts(
    frame: FrameResult, condition: str, name: str, stratum: Stratum, min_score: float
) -> tuple[int, ...]:
    cloud, truth = frame.clouds()[condition], frame.truth
    objects = stratum.holds(box_range_m(truth.boxes.geometry))
    detections = stratum.holds(box_range_m(cloud.detections.boxes))
    if name != EVERY_CLASS:
        objects &= labelled(truth.boxes.labels, name)
        detections &= labelled(cloud.detections.labels, name)
    return (
        int((found_objects(truth, frame.clean.matches, min_score) & objects).sum()),
        int((lost_objects(truth, frame.clean, cloud, min_score) & objects).sum()),
        int((new_false_positives(frame.clean, cloud, min_score) & detections).sum()),
        int((found_objects(truth, frame.clean.matches, min_score, "strict") & objects).sum()),
        int((lost_objects(truth, frame.clean, cloud, min_score, "strict") & objects).sum()),
        int((displaced_objects(truth, frame.clean, cloud, min_score) & objects).sum()),
    )


def share_draws(counts: Int64, bootstrap: BlockBootstrap) -> npt.NDArray[np.float64]:
    """A part in percent of a whole in each draw; counts: (F, 2), the whole and the part in each frame."""
    whole, part = (
        np.bincount(bootstrap.block, counts[:, column], minlength=bootstrap.n_blocks) for column in (0, 1)
    )
    return bootstrap.samples(lambda times: 100 * (times @ part) / above_0((times @ whole).astype(np.float64)))
