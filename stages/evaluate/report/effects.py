"""The section on what each attack and each random baseline leaves, strict and loose side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from advpipe.pipeline.results.records import EffectRecord
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.effect import ALL, ATTACKED
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import (
    NOTHING,
    formatted_number,
    formatted_ratio,
    interval_of_blocks,
    with_interval,
)
from advpipe.stages.evaluate.report.section import ReportSection, Table
from advpipe.stages.evaluate.report.wording import OVERLAPS

HEADS = (
    *("attack", "condition", "frames", "mAP ratio, strict %", "mAP ratio, loose %"),
    *("lost", "lost %", "displaced", "displaced %", "RMS shift m", "CD m²"),
)


def effects_section(summaries: Mapping[str, Summary]) -> ReportSection:
    """A line for each attack, baseline and choice of frames; summaries: by the attack's title."""
    lines = [line for title, summary in summaries.items() for line in _lines(title, summary)]
    choices = {each.frames for summary in summaries.values() for each in summary.effects}
    lead = (
        "Lost: found on the clean clouds and not found here, at loose overlap. Displaced: found on the clean "
        "clouds at strict overlap, and here at loose overlap only. Both with a score of at least the working "
        f"score, in percent of the objects found on the clean clouds; {OVERLAPS}."
    )
    if ATTACKED in choices:
        lead += (
            " Attacked frames are those in which the attack changed points; baselines are of the same frames."
        )
    return ReportSection(
        "attack_effects",
        "Strict and loose overlap, lost and displaced objects",
        lead,
        (Table("mAP ratios with their 95 % intervals, and objects", HEADS, tuple(lines)),),
        records=tuple(each for summary in summaries.values() for each in summary.effects),
    )


def _lines(title: str, summary: Summary) -> Iterator[tuple[str, ...]]:
    tries = summary.result.attack.baseline_tries
    for number, each in enumerate(summary.effects):
        yield (
            title if number == 0 else "",
            "attacked" if each.condition == "adv" else baseline_title(each.condition, tries),
            f"{'all' if each.frames == ALL else 'attacked'} {each.frame_count:,}",
            _ratio(each, "strict", summary),
            _ratio(each, "loose", summary),
            f"{each.lost_objects:,} of {each.found_clean:,}",
            _percent(each.lost_percent, interval_of_blocks(each.lost_ci95, each.blocks)),
            f"{each.displaced_objects:,} of {each.strict_found_clean:,}",
            _percent(each.displaced_percent, interval_of_blocks(each.displaced_ci95, each.blocks)),
            *_change(summary, each),
        )


def _change(summary: Summary, each: EffectRecord) -> tuple[str, str]:
    """How far points moved, and the Chamfer distance; over all frames alone."""
    metrics = summary.result.metrics_of("" if each.condition == "adv" else each.condition)
    if metrics is None or each.frames != ALL:
        return NOTHING, NOTHING
    shift = formatted_number(metrics.rms_displacement_m or None, 4)
    return shift, formatted_number(metrics.chamfer_distance_m2, 5)


def _ratio(each: EffectRecord, criterion: str, summary: Summary) -> str:
    is_strict = criterion == "strict"
    percent = each.map_ratio_percent if is_strict else each.map_loose_ratio_percent
    bounds = each.map_ratio_ci95 if is_strict else each.map_loose_ratio_ci95
    map_clean = summary.result.clean.means[criterion].map_r40
    if map_clean == 0 or percent != percent:
        return formatted_ratio(percent, map_clean)
    return _percent(percent, interval_of_blocks(bounds, each.blocks))


def _percent(value: float, bounds: object) -> str:
    return NOTHING if formatted_number(value, 1) == NOTHING else with_interval(value, bounds, 1)
