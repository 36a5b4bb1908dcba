"""What each defence costs on clean clouds, and what it leaves of an attack and of random-best."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.pipeline.results.records import DefenceRecord, DefendedBaseline, DefendedMetrics
from advpipe.pipeline.results.row import RANDOM_BEST, ResultRow
from advpipe.stages.evaluate.detection.comparison import FrameResult, under
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches
from advpipe.stages.evaluate.detection.metrics import difference, map_ratio_percent, precisions, ratio_draws
from advpipe.stages.evaluate.detection.result import is_below_0
from advpipe.stages.evaluate.detection.scored import Scored

NO_DEFENCE = "none"
"""The record of the same frames without a defence, beside which the others are read."""


def defence_records(
    scored: Scored,
    result: ResultRow,
    bootstrap_of: Callable[[Sequence[FrameResult]], BlockBootstrap],
) -> Iterator[DefenceRecord]:
    """A record for each defence, and before them one without; all of the frames that were defended."""
    frames = [frame for frame in scored.comparison.frames if frame.defended]
    if not frames:
        return
    bootstrap = bootstrap_of(frames)

    def matches(condition: str, defence: str) -> ConditionMatches:
        name = condition if defence == NO_DEFENCE else under(condition, defence)
        return ConditionMatches.of(frames, name, scored.classes, scored.in_map, bootstrap)

    conditions = [name for name in ("clean", "adv", RANDOM_BEST) if name in scored.by_condition]
    undefended = matches("clean", NO_DEFENCE)
    for defence in (NO_DEFENCE, *scored.comparison.defences):
        by_condition = {condition: matches(condition, defence) for condition in conditions}
        yield _Defended(result, defence, len(frames), by_condition, undefended).record()


@dataclass(frozen=True)
class _Defended:
    """The matches under a defence, by condition, and those on the clean clouds without one."""

    result: ResultRow
    defence: str
    frames: int
    by_condition: dict[str, ConditionMatches]
    undefended: ConditionMatches

    def record(self) -> DefenceRecord:
        clean = self.by_condition["clean"]
        return DefenceRecord(
            *self.result.identity,
            defence=self.defence,
            frames=self.frames,
            blocks=clean.bootstrap.n_blocks,
            map_clean=clean.mean_ap(),
            map_clean_ci95=percentile_interval(clean.map_draws()),
            clean_map_kept_percent=map_ratio_percent(clean.mean_ap(), self.undefended),
            clean_map_kept_ci95=percentile_interval(ratio_draws(clean, self.undefended)),
            clean_map_loose_kept_percent=map_ratio_percent(clean.mean_ap("loose"), self.undefended, "loose"),
            clean_precisions=precisions(clean),
            attacked=self._attacked(clean) if "adv" in self.by_condition else None,
            baseline=self._baseline(clean) if RANDOM_BEST in self.by_condition else None,
        )

    def _attacked(self, clean: ConditionMatches) -> DefendedMetrics:
        after, undefended = self.by_condition["adv"], self.undefended
        return DefendedMetrics(
            map_adv=after.mean_ap(),
            map_adv_ci95=percentile_interval(after.map_draws()),
            map_ratio_percent=map_ratio_percent(after.mean_ap(), clean),
            map_ratio_ci95=percentile_interval(ratio_draws(after, clean)),
            map_adv_percent=map_ratio_percent(after.mean_ap(), undefended),
            map_adv_percent_ci95=percentile_interval(ratio_draws(after, undefended)),
            map_loose_ratio_percent=map_ratio_percent(after.mean_ap("loose"), clean, "loose"),
            map_loose_ratio_ci95=percentile_interval(ratio_draws(after, clean, "loose")),
            precisions=precisions(after),
        )

    def _baseline(self, clean: ConditionMatches) -> DefendedBaseline:
        random = self.by_condition[RANDOM_BEST]
        points, bounds = difference(self.by_condition, RANDOM_BEST)
        loose_points, loose_bounds = difference(self.by_condition, RANDOM_BEST, "loose")
        return DefendedBaseline(
            random_best_map_adv=random.mean_ap(),
            random_best_map_ratio_percent=map_ratio_percent(random.mean_ap(), clean),
            random_best_map_ratio_ci95=percentile_interval(ratio_draws(random, clean)),
            map_ratio_delta_points_vs_random_best=points,
            map_ratio_delta_points_vs_random_best_ci95=bounds,
            significant_vs_random_best=is_below_0(bounds, clean.bootstrap),
            random_best_map_loose_ratio_percent=map_ratio_percent(random.mean_ap("loose"), clean, "loose"),
            random_best_map_loose_ratio_ci95=percentile_interval(ratio_draws(random, clean, "loose")),
            map_loose_ratio_delta_points_vs_random_best=loose_points,
            map_loose_ratio_delta_points_vs_random_best_ci95=loose_bounds,
        )
