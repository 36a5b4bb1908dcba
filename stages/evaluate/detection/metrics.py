"""The metrics of attacked clouds and, equally, of each random baseline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.average_precision import R11, RankedMatches, mean_average_precision
from advpipe.pipeline.metrics.bootstrap import percentile_interval
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.pipeline.results.metrics import (
    CleanMeans,
    CleanMetrics,
    CloudMetrics,
    Interval,
    Precisions,
    RecountedMetrics,
    ratio_reason,
)
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches, ap_draws
from advpipe.stages.evaluate.detection.displacement import Displacement
from advpipe.stages.evaluate.detection.point_traces import PointTraces
from advpipe.stages.evaluate.detection.scoring import CRITERIA

Float64 = npt.NDArray[np.float64]


def attack_metrics(
    evaluated: ConditionMatches,
    clean: ConditionMatches,
    frames: Sequence[FrameResult],
    rows: Sequence[FrameRow],
    condition: str,
) -> CloudMetrics:
    """The metrics of a condition; rows: of the same frames, as `frame_row` makes them."""
    counts = [row.clouds[condition] for row in rows]
    found, lost = found_on_clean(rows), sum(each.lost_objects for each in counts)
    way = Displacement.over([frame.clouds()[condition].displacement for frame in frames])
    traces = PointTraces.over([frame.clouds()[condition].traces for frame in frames])
    return CloudMetrics(
        map_adv=evaluated.mean_ap(),
        map_adv_ci95=percentile_interval(evaluated.map_draws()),
        map_ratio_percent=map_ratio_percent(evaluated.mean_ap(), clean),
        map_ratio_ci95=percentile_interval(ratio_draws(evaluated, clean)),
        map_loose_adv=evaluated.mean_ap("loose"),
        map_loose_ratio_percent=map_ratio_percent(evaluated.mean_ap("loose"), clean, "loose"),
        map_bev_adv=evaluated.mean_ap("bev"),
        map_bev_loose_adv=evaluated.mean_ap("bev_loose"),
        precisions=precisions(evaluated),
        chamfer_distance_m2=sum(each.chamfer_distance_m2 for each in counts) / len(rows),
        attack_success_percent=100 * ratio(lost, found),
        mean_displacement_m=way.mean_m,
        rms_displacement_m=way.rms_m,
        median_displacement_m=way.median_m,
        p95_displacement_m=way.p95_m,
        max_displacement_m=way.max_m,
        max_added_m=way.max_added_m,
        points_added=sum(each.points_added for each in counts),
        points_removed=sum(each.points_removed for each in counts),
        points_moved=sum(each.points_moved for each in counts),
        objects_below_min_points=sum(each.objects_below_min_points for each in counts),
        found_objects=sum(each.found_objects for each in counts),
        false_positives=sum(each.false_positives for each in counts),
        lost_objects=sum(each.lost_objects for each in counts),
        new_false_positives=sum(each.new_false_positives for each in counts),
        map_loose_ratio_ci95=percentile_interval(ratio_draws(evaluated, clean, "loose")),
        points_off_ray=traces.off_ray,
        at_face_percent=100 * ratio(traces.at_face, traces.in_grid),
        at_face_clean_percent=100 * ratio(traces.clean_at_face, traces.clean_in_grid),
    )


def recounted_metrics(
    evaluated: ConditionMatches,
    clean: ConditionMatches,
    frames: Sequence[FrameResult],
    rows: Sequence[FrameRow],
    condition: str,
) -> RecountedMetrics:
    """The same metrics with objects counted on the attacked clouds; secondary to those on the clean ones.

    Removing points leaves objects, hidden ones among them, with fewer than the minimum of points; adding
    points lifts others above it.
    """
    clouds = [frame.clouds()[condition] for frame in frames]
    recounted = [cloud.matches if cloud.recounted is None else cloud.recounted for cloud in clouds]
    ranked = {
        name: RankedMatches.of([matches["strict", name] for matches in recounted])
        for criterion, name in evaluated.ranked
        if criterion == "strict"
    }
    draws = {name: ap_draws(each, evaluated.bootstrap) for name, each in ranked.items()}
    mean_ap = float(mean_average_precision([ranked[name].average_precision() for name in evaluated.in_map]))
    map_draws: Float64 = mean_average_precision([draws[name] for name in evaluated.in_map])
    lost = sum(row.clouds[condition].lost_objects_recounted for row in rows)
    return RecountedMetrics(
        objects_recounted=sum(int(each.n_truth.sum()) for each in ranked.values()),
        map_adv_recounted=mean_ap,
        map_ratio_percent_recounted=map_ratio_percent(mean_ap, clean),
        map_ratio_recounted_ci95=percentile_interval(100 * map_draws / ratio_base_draws(clean)),
        lost_objects_recounted=lost,
        attack_success_percent_recounted=100 * ratio(lost, found_on_clean(rows)),
    )


def difference(
    by_condition: Mapping[str, ConditionMatches], condition: str, criterion: str = "strict"
) -> tuple[float, Interval]:
    """The mAP ratio of the attack minus that of a baseline, in percentage points, with a paired interval."""
    clean, adversarial, baseline = by_condition["clean"], by_condition["adv"], by_condition[condition]
    draws = ratio_draws(adversarial, clean, criterion) - ratio_draws(baseline, clean, criterion)
    lost = adversarial.mean_ap(criterion) - baseline.mean_ap(criterion)
    points = map_ratio_percent(lost, clean, criterion)
    return points, percentile_interval(draws)


def clean_metrics(clean: ConditionMatches) -> CleanMetrics:
    """mAP on the clean clouds by every criterion, and average precisions."""
    means = {
        criterion: CleanMeans(
            map_r40=clean.mean_ap(criterion),
            map_r40_ci95=percentile_interval(clean.map_draws(criterion)),
            map_r11=clean.mean_ap(criterion, R11),
        )
        for criterion in CRITERIA
    }
    return CleanMetrics(means, precisions(clean))


def precisions(evaluated: ConditionMatches) -> Precisions:
    """Average precision of each class by every criterion."""
    return Precisions(
        {key: ranked.average_precision() for key, ranked in evaluated.ranked.items()},
        {
            name: percentile_interval(evaluated.draws[criterion, name])
            for criterion, name in evaluated.ranked
            if criterion == "strict"
        },
    )


def ratio(part: float, whole: float) -> float:
    """The quotient; NaN where the whole is 0."""
    return part / whole if whole else float("nan")


def reason_against(whole: ConditionMatches, criterion: str = "strict") -> str:
    """Why a ratio to the mAP of a condition is not meaningful; "" where it is."""
    return ratio_reason(whole.mean_ap(criterion), percentile_interval(whole.map_draws(criterion)))


def map_ratio_percent(part: float, whole: ConditionMatches, criterion: str = "strict") -> float:
    """A mAP in percent of that of a condition; NaN where that is not meaningful."""
    return math.nan if reason_against(whole, criterion) else 100 * ratio(part, whole.mean_ap(criterion))


def ratio_draws(evaluated: ConditionMatches, whole: ConditionMatches, criterion: str = "strict") -> Float64:
    """The mAP ratio in percent (draws,); NaN where the whole is 0, or the ratio is not meaningful."""
    return 100 * evaluated.map_draws(criterion) / ratio_base_draws(whole, criterion)


def ratio_base_draws(whole: ConditionMatches, criterion: str = "strict") -> Float64:
    """The mAP (draws,) that ratios are of; NaN where it is 0, or a ratio to it is not meaningful."""
    draws = whole.map_draws(criterion)
    return np.full_like(draws, np.nan) if reason_against(whole, criterion) else above_0(draws)


def above_0(values: Float64) -> Float64:
    """The values (N,), with NaN for those that are not above 0."""
    return np.where(values > 0, values, np.nan)


def found_on_clean(rows: Sequence[FrameRow]) -> int:
    """How many objects the detector finds in the clean clouds of some frames."""
    return sum(row.clouds["clean"].found_objects for row in rows)
