"""What the attacked clouds lead to, in figures; and each random baseline, by the same words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.average_precision import R11, RankedMatches
from advpipe.pipeline.metrics.bootstrap import percentile_interval
from advpipe.pipeline.results.figures import (
    CleanFigures,
    CleanMeans,
    CloudFigures,
    Interval,
    Precisions,
    RecountedFigures,
)
from advpipe.stages.evaluate.detection.arm import Arm, ap_draws
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.displacement import Displacement
from advpipe.stages.evaluate.detection.scoring import CRITERIA

Row = dict[str, object]
FrameRows = Sequence[Mapping[str, int | float | None]]
Float64 = npt.NDArray[np.float64]


def attack_figures(
    arm: Arm, clean: Arm, frames: Sequence[FrameResult], rows: FrameRows, word: str
) -> CloudFigures:
    """What the clouds `word` lead to; rows: of the same frames, as `frame_row` makes them."""
    found, lost = total(rows, "found_objects_clean"), total(rows, f"lost_objects_{word}")
    way = Displacement.over([frame.clouds()[word].displacement for frame in frames])
    return CloudFigures(
        map_adv=arm.mean_ap(),
        map_adv_ci95=percentile_interval(arm.map_draws()),
        map_ratio_percent=100 * ratio(arm.mean_ap(), clean.mean_ap()),
        map_ratio_ci95=percentile_interval(ratio_draws(arm, clean)),
        map_loose_adv=arm.mean_ap("loose"),
        map_loose_ratio_percent=100 * ratio(arm.mean_ap("loose"), clean.mean_ap("loose")),
        map_bev_adv=arm.mean_ap("bev"),
        map_bev_loose_adv=arm.mean_ap("bev_loose"),
        precisions=precisions(arm),
        chamfer_distance_m2=total(rows, f"chamfer_distance_m2_{word}") / len(rows),
        attack_success_percent=100 * ratio(lost, found),
        mean_displacement_m=way.mean_m,
        rms_displacement_m=way.rms_m,
        median_displacement_m=way.median_m,
        p95_displacement_m=way.p95_m,
        max_displacement_m=way.max_m,
        max_added_m=way.max_added_m,
        points_added=count(rows, f"points_added_{word}"),
        points_removed=count(rows, f"points_removed_{word}"),
        points_moved=count(rows, f"points_moved_{word}"),
        objects_below_min_points=count(rows, f"objects_below_min_points_{word}"),
        found_objects=count(rows, f"found_objects_{word}"),
        false_positives=count(rows, f"false_positives_{word}"),
        lost_objects=count(rows, f"lost_objects_{word}"),
        new_false_positives=count(rows, f"new_false_positives_{word}"),
    )


def recounted_figures(
    arm: Arm, clean: Arm, frames: Sequence[FrameResult], rows: FrameRows, word: str
) -> RecountedFigures:
    """The same if the objects were counted on the attacked clouds: shown beside, for it is not what counts.

    Removing points pushes objects under the minimum of points, and with them what the attack hid; adding
    some lifts others over it.
    """
    clouds = [frame.clouds()[word] for frame in frames]
    recounted = [cloud.matches if cloud.recounted is None else cloud.recounted for cloud in clouds]
    ranked = {
        name: RankedMatches.of([matches["strict", name] for matches in recounted])
        for criterion, name in arm.ranked
        if criterion == "strict"
    }
    draws = {name: ap_draws(each, arm.bootstrap) for name, each in ranked.items()}
    mean_ap = arm.mean_of({name: each.average_precision() for name, each in ranked.items()})
    map_draws = arm.mean_of_draws(draws)
    lost = count(rows, f"lost_objects_recounted_{word}")
    return RecountedFigures(
        objects_recounted=sum(int(each.n_truth.sum()) for each in ranked.values()),
        map_adv_recounted=mean_ap,
        map_ratio_percent_recounted=100 * ratio(mean_ap, clean.mean_ap()),
        map_ratio_recounted_ci95=percentile_interval(100 * map_draws / above_0(clean.map_draws())),
        lost_objects_recounted=lost,
        attack_success_percent_recounted=100 * ratio(lost, total(rows, "found_objects_clean")),
    )


def difference(arms: Mapping[str, Arm], word: str) -> tuple[float, Interval]:
    """How many points of mAP ratio the attack costs beyond the baseline `word`, drawn together."""
    clean, adversarial, baseline = arms["clean"], arms["adv"], arms[word]
    draws = ratio_draws(adversarial, clean) - ratio_draws(baseline, clean)
    points = 100 * ratio(adversarial.mean_ap() - baseline.mean_ap(), clean.mean_ap())
    return points, percentile_interval(draws)


def clean_figures(clean: Arm) -> CleanFigures:
    """mAP on the clean clouds by every criterion, and average precisions."""
    means = {
        criterion: CleanMeans(
            map_r40=clean.mean_ap(criterion),
            map_r40_ci95=percentile_interval(clean.map_draws(criterion)),
            map_r11=clean.mean_ap(criterion, R11),
        )
        for criterion in CRITERIA
    }
    return CleanFigures(means, precisions(clean))


def precisions(arm: Arm) -> Precisions:
    """Average precision of each class by every criterion."""
    return Precisions(
        {key: ranked.average_precision() for key, ranked in arm.ranked.items()},
        {
            name: percentile_interval(arm.draws[criterion, name])
            for criterion, name in arm.ranked
            if criterion == "strict"
        },
    )


def ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def ratio_draws(arm: Arm, whole: Arm) -> Float64:
    """The mAP ratio in percent (draws,); NaN where the whole is 0."""
    return 100 * arm.map_draws() / above_0(whole.map_draws())


def above_0(values: Float64) -> Float64:
    return np.where(values > 0, values, np.nan)


def column(rows: FrameRows, name: str) -> list[int | float]:
    return [value for row in rows if (value := row[name]) is not None]


def total(rows: FrameRows, name: str) -> int | float:
    return sum(column(rows, name))


def count(rows: FrameRows, name: str) -> int:
    return int(total(rows, name))
