"""What each condition leaves of the detector's results, over all frames and over the attacked ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.pipeline.results.records import EffectRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches
from advpipe.stages.evaluate.detection.metrics import map_ratio_percent, ratio, ratio_draws
from advpipe.stages.evaluate.detection.scored import Scored
from advpipe.stages.evaluate.detection.scoring import found_objects
from advpipe.stages.evaluate.detection.success import share_draws

ALL, ATTACKED = "all", "attacked"
"""Which frames an `EffectRecord` is of."""


def effect_records(
    scored: Scored,
    result: ResultRow,
    conditions: Sequence[str],
    bootstrap_of: Callable[[Sequence[FrameResult]], BlockBootstrap],
) -> Iterator[EffectRecord]:
    """A record for each condition over all frames; where the attack left some alone, also over the others."""
    frames = scored.comparison.frames
    for condition in conditions:
        of = scored.by_condition[condition], scored.by_condition["clean"]
        yield _record(scored, result, condition, ALL, frames, of)
    attacked = [frame for frame in frames if frame.is_attacked]
    if not 0 < len(attacked) < len(frames):
        return
    bootstrap = bootstrap_of(attacked)
    matches = {
        condition: ConditionMatches.of(attacked, condition, scored.classes, scored.in_map, bootstrap)
        for condition in ("clean", *conditions)
    }
    for condition in conditions:
        yield _record(scored, result, condition, ATTACKED, attacked, (matches[condition], matches["clean"]))


def _record(
    scored: Scored,
    result: ResultRow,
    condition: str,
    which: str,
    frames: Sequence[FrameResult],
    matches: tuple[ConditionMatches, ConditionMatches],
) -> EffectRecord:
    """matches: of the condition and of the clean clouds, over these frames."""
    evaluated, clean = matches
    bootstrap = evaluated.bootstrap
    row_of = {row.frame: row for row in scored.per_frame}
    rows = [row_of[frame.index] for frame in frames]
    lost = np.array([_lost(row, condition) for row in rows])
    displaced = np.array(
        [
            (
                int(found_objects(frame.clean.matches, scored.min_score, "strict").sum()),
                row.clouds[condition].displaced_objects,
            )
            for frame, row in zip(frames, rows, strict=True)
        ]
    )
    found, n_lost = map(int, lost.sum(axis=0))
    strictly_found, n_displaced = map(int, displaced.sum(axis=0))
    return EffectRecord(
        *result.identity,
        condition=condition,
        frames=which,
        frame_count=len(frames),
        blocks=bootstrap.n_blocks,
        map_ratio_percent=map_ratio_percent(evaluated.mean_ap(), clean),
        map_ratio_ci95=percentile_interval(ratio_draws(evaluated, clean)),
        map_loose_ratio_percent=map_ratio_percent(evaluated.mean_ap("loose"), clean, "loose"),
        map_loose_ratio_ci95=percentile_interval(ratio_draws(evaluated, clean, "loose")),
        found_clean=found,
        lost_objects=n_lost,
        lost_percent=100 * ratio(n_lost, found),
        lost_ci95=percentile_interval(share_draws(lost, bootstrap)),
        strict_found_clean=strictly_found,
        displaced_objects=n_displaced,
        displaced_percent=100 * ratio(n_displaced, strictly_found),
        displaced_ci95=percentile_interval(share_draws(displaced, bootstrap)),
    )


def _lost(row: FrameRow, condition: str) -> tuple[int, int]:
    """How many objects are found on the clean cloud of a frame, and how many of these are lost here."""
    return row.clouds["clean"].found_objects, row.clouds[condition].lost_objects
