"""How much a defence restores: average precision on clean and attacked clouds under it."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.metrics.bootstrap import percentile_interval
from advpipe.pipeline.results.records import DefenceRecord, DefendedMetrics
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.comparison import under
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches
from advpipe.stages.evaluate.detection.metrics import map_ratio_percent, precisions, ratio_draws
from advpipe.stages.evaluate.detection.scored import Scored


def defence_records(scored: Scored, result: ResultRow) -> Iterator[DefenceRecord]:
    """A record for each defence: mAP on clean and attacked clouds under it, and its cost on clean ones."""
    clean = scored.by_condition["clean"]
    for defence in scored.comparison.defences:
        before = scored.matches_under(under("clean", defence))
        yield DefenceRecord(
            *result.identity,
            defence=defence,
            frames=result.counts.frames,
            map_clean=before.mean_ap(),
            map_clean_ci95=percentile_interval(before.map_draws()),
            clean_map_kept_percent=map_ratio_percent(before.mean_ap(), clean),
            clean_map_kept_ci95=percentile_interval(ratio_draws(before, clean)),
            clean_precisions=precisions(before),
            attacked=_attacked(scored, defence, before) if "adv" in scored.by_condition else None,
        )


def _attacked(scored: Scored, defence: str, before: ConditionMatches) -> DefendedMetrics:
    clean, after = scored.by_condition["clean"], scored.matches_under(under("adv", defence))
    return DefendedMetrics(
        map_adv=after.mean_ap(),
        map_adv_ci95=percentile_interval(after.map_draws()),
        map_ratio_percent=map_ratio_percent(after.mean_ap(), before),
        map_ratio_ci95=percentile_interval(ratio_draws(after, before)),
        map_adv_percent=map_ratio_percent(after.mean_ap(), clean),
        map_adv_percent_ci95=percentile_interval(ratio_draws(after, clean)),
        precisions=precisions(after),
    )
