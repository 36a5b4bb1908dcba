"""The row of a report that a scored comparison makes, and its notes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.bootstrap import MIN_BLOCK_S, BlockBootstrap
from advpipe.pipeline.results.metrics import BaselineMetrics, CloudMetrics, Interval
from advpipe.pipeline.results.row import RANDOM_BEST, AttackRecord, FrameCounts, ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_names, baseline_title
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.metrics import (
    attack_metrics,
    clean_metrics,
    difference,
    found_on_clean,
    reason_against,
    recounted_metrics,
)
from advpipe.stages.evaluate.detection.scored import Scored
from advpipe.stages.evaluate.detection.uncounted_notes import uncounted_notes

MIN_BLOCKS = 6
"""With fewer blocks of frames, reports show no interval: it would be too narrow."""

FEW_BLOCKS = 10
"""With fewer blocks, intervals are rough."""


def result_row(
    scored: Scored, boxes: Mapping[str, int], notes: Sequence[str], warnings: Sequence[str]
) -> ResultRow:
    """The metrics of a comparison; boxes: evaluated ones by class. notes, warnings: first and last notes."""
    comparison, by_condition, rows = scored.comparison, scored.by_condition, scored.per_frame
    attack = attack_of(comparison)
    attacked = _metrics(scored, "adv") if "adv" in by_condition else None
    baselines = {
        condition: _baseline(scored, condition) for condition in baseline_names() if condition in by_condition
    }
    random = baselines.get(RANDOM_BEST)
    significant_vs_random = random.is_significant if random else None
    return ResultRow(
        bag=comparison.name,
        detector=comparison.detector,
        attack=attack,
        counts=FrameCounts(
            frames=len(rows),
            blocks=scored.bootstrap.n_blocks,
            classes_in_map=scored.in_map,
            working_score=scored.min_score,
            objects=sum(boxes.values()),
            objects_found_clean=found_on_clean(rows),
            false_positives_clean=sum(row.clouds["clean"].false_positives for row in rows),
            points_clean=sum(row.clouds["clean"].points for row in rows),
        ),
        boxes={name: boxes[name] for name in scored.classes},
        clean=clean_metrics(by_condition["clean"]),
        attacked=attacked,
        recounted=(
            recounted_metrics(by_condition["adv"], by_condition["clean"], comparison.frames, rows, "adv")
            if attacked
            else None
        ),
        baselines=baselines,
        significant_vs_random=significant_vs_random,
        notes=(*notes, *_notes(scored, attack, attacked, significant_vs_random), *warnings),
    )


def attack_of(comparison: Comparison) -> AttackRecord:
    """Attack, recipe, and its budget: the parameter that the attack names, else its first."""
    provenance = comparison.provenance
    parameters = provenance.parameters
    parameter = provenance.get("budget", next(iter(parameters), None))
    return AttackRecord(
        attack=provenance.get("attack", "none" if not provenance else "unknown"),
        recipe=provenance.get("recipe"),
        parameter=parameter,
        value=parameters.get(parameter) if parameter else None,
        parameters=parameters,
        attacked_against=provenance.get("detector"),
        is_white_box=comparison.is_white_box,
        query_budget=provenance.fields.looks,
        baseline_tries=comparison.baseline_tries,
    )


def _metrics(scored: Scored, condition: str) -> CloudMetrics:
    by_condition, frames = scored.by_condition, scored.comparison.frames
    return attack_metrics(by_condition[condition], by_condition["clean"], frames, scored.per_frame, condition)


def _baseline(scored: Scored, condition: str) -> BaselineMetrics:
    """A random baseline; the attack is significantly stronger if the 95 % interval of Δ is below 0, at strict
    overlap.

    With fewer than `MIN_BLOCKS` blocks, whose interval no table shows, nothing is said of significance.
    """
    points, bounds = difference(scored.by_condition, condition)
    loose_points, loose_bounds = difference(scored.by_condition, condition, "loose")
    return BaselineMetrics(
        metrics=_metrics(scored, condition),
        map_ratio_delta_points=points,
        map_ratio_delta_points_ci95=bounds,
        is_significant=is_below_0(bounds, scored.bootstrap),
        map_loose_ratio_delta_points=loose_points,
        map_loose_ratio_delta_points_ci95=loose_bounds,
    )


def is_below_0(bounds: Interval, bootstrap: BlockBootstrap) -> bool | None:
    """Whether an interval lies below 0; None without one, and with fewer than `MIN_BLOCKS` blocks."""
    return bounds[1] < 0 if bounds and bootstrap.n_blocks >= MIN_BLOCKS else None


def _notes(
    scored: Scored,
    attack: AttackRecord,
    attacked: CloudMetrics | None,
    significant_vs_random: bool | None,
) -> Iterator[str]:
    """Notes on too few blocks, an undefined mAP ratio, objects with few points left, and weak or strong
    baselines."""
    n_blocks, baseline_tries = scored.bootstrap.n_blocks, attack.baseline_tries
    if n_blocks < MIN_BLOCKS:
        yield (
            f"Tables show no interval: that takes {MIN_BLOCKS} blocks of {MIN_BLOCK_S:g} s, and the frames "
            f"fill {n_blocks}."
        )
    elif n_blocks < FEW_BLOCKS:
        yield f"Only {n_blocks} blocks of {MIN_BLOCK_S:g} s: the confidence intervals are rough."
    reason = reason_against(scored.by_condition["clean"])
    if attacked and scored.by_condition["clean"].mean_ap() == 0:
        yield "mAP ratio undefined: nothing found on the clean bag at strict overlap."
    elif attacked and reason:
        yield f"mAP ratio not meaningful: {reason}."
    yield from uncounted_notes(scored.comparison.frames)
    if attacked and (hidden := attacked.objects_below_min_points):
        yield f"{hidden} of the objects have fewer than {MIN_POINTS} points left; they still count."
    if attack.parameters.get("truth") == "detections":
        yield "The attacker was given the detections in the clean clouds, not the true boxes."
    if attack.query_budget is not None and 0 < baseline_tries < attack.query_budget:
        beside = baseline_title(RANDOM_BEST, baseline_tries)
        yield f"Fewer tries than the attack's {attack.query_budget}: {beside}."
    if significant_vs_random is False:
        yield f"Not significantly stronger than {baseline_title(RANDOM_BEST, baseline_tries)}."
