"""The section on defences: their clean cost, and what each leaves of an attack and of random-best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.records import DefenceRecord
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.defended import NO_DEFENCE
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import (
    ANSWER,
    NOTHING,
    formatted_number,
    formatted_ratio,
    interval_cell,
)
from advpipe.stages.evaluate.report.section import ReportSection, Table
from advpipe.stages.evaluate.report.wording import TO_BEAT

HEADS = (
    *("attack", "defence", "mAP clean", "kept %", "mAP attacked", "% of clean", "ratio %", "95 %"),
    *(f"{TO_BEAT}: ratio %", f"Δ to {TO_BEAT}, points", "95 %", "significant"),
)

LOOSE_HEADS = (
    *("attack", "defence", "kept %", "ratio %", "95 %"),
    *(f"{TO_BEAT}: ratio %", f"Δ to {TO_BEAT}, points", "95 %"),
)

LEAD = (
    "Each defence changes every cloud before the detector sees it, with the same draws for the clean, the "
    "attacked and the random one. Kept is a defence's cost: mAP on clean clouds under it, in percent of that "
    "without. % of clean: mAP on attacked clouds under the defence, in percent of that on clean clouds "
    "without it. Ratio: mAP in percent of that on clean clouds, both under the defence; of the attack, and "
    f"of {TO_BEAT}, and Δ between the two, drawn together: the attack is significantly stronger under a "
    "defence if the 95 % interval of Δ at strict overlap lies below 0."
)


def defences_section(
    summaries: Sequence[Summary], title_of: Callable[[Summary, Sequence[Summary]], str]
) -> ReportSection:
    """Each attack under each defence; the first line of an attack is of the same frames without one."""
    defended = [summary for summary in summaries if summary.defended]
    lines, loose_lines = [], []
    for summary in defended:
        for each in summary.defended:
            title = title_of(summary, summaries) if each.defence == NO_DEFENCE else ""
            lines.append(_line(title, each, summary.defended[0]))
            loose_lines.append(_loose_line(title, each))
    return ReportSection(
        "defences",
        "Under defences",
        LEAD,
        (
            Table("Each attack under each defence, on the same frames, strictly", HEADS, tuple(lines)),
            Table("The same at loose overlap", LOOSE_HEADS, tuple(loose_lines)),
        ),
        notes=tuple(_note(title_of(summary, summaries), summary) for summary in defended),
        records=tuple(each for summary in defended for each in summary.defended),
    )


def _line(title: str, record: DefenceRecord, undefended: DefenceRecord) -> tuple[str, ...]:
    attacked, random = record.attacked, record.baseline
    map_clean = undefended.map_clean
    return (
        title,
        record.defence,
        formatted_number(record.map_clean, 3),
        formatted_ratio(record.clean_map_kept_percent, map_clean, 1),
        formatted_number(attacked and attacked.map_adv, 3),
        formatted_ratio(attacked.map_adv_percent, map_clean, 1) if attacked else NOTHING,
        formatted_ratio(attacked.map_ratio_percent, record.map_clean) if attacked else NOTHING,
        interval_cell(attacked.map_ratio_ci95, record) if attacked else NOTHING,
        formatted_ratio(random.random_best_map_ratio_percent, record.map_clean) if random else NOTHING,
        formatted_number(random and random.map_ratio_delta_points_vs_random_best, 2),
        interval_cell(random.map_ratio_delta_points_vs_random_best_ci95, record) if random else NOTHING,
        ANSWER[random.significant_vs_random_best] if random else NOTHING,
    )


def _loose_line(title: str, record: DefenceRecord) -> tuple[str, ...]:
    attacked, random = record.attacked, record.baseline
    return (
        title,
        record.defence,
        formatted_number(record.clean_map_loose_kept_percent, 1),
        formatted_number(attacked and attacked.map_loose_ratio_percent, 2),
        interval_cell(attacked.map_loose_ratio_ci95, record) if attacked else NOTHING,
        formatted_number(random and random.random_best_map_loose_ratio_percent, 2),
        formatted_number(random and random.map_loose_ratio_delta_points_vs_random_best, 2),
        interval_cell(random.map_loose_ratio_delta_points_vs_random_best_ci95, record) if random else NOTHING,
    )


def _note(title: str, summary: Summary) -> str:
    """The ratios under every defence in a sentence, with those of random-best in brackets."""
    (undefended, *others), counts = summary.defended, summary.result.counts
    of = f"{title} under defences, on {undefended.frames} of {counted(counts.frames, 'frame')}"
    if undefended.attacked is None:
        kept = [f"{each.defence} {_percent(each.clean_map_kept_percent)}" for each in others]
        return f"{of}, mAP kept: {', '.join(kept)}."
    random = baseline_title(RANDOM_BEST, summary.comparison.baseline_tries)
    ratios = ", ".join(
        f"{each.defence} {_percent(each.attacked.map_ratio_percent if each.attacked else None)}"
        + (f" ({_percent(each.baseline.random_best_map_ratio_percent)})" if each.baseline else "")
        for each in summary.defended
    )
    return f"{of}, mAP ratio{f' (of {random})' if undefended.baseline else ''}: {ratios}."


def _percent(ratio: float | None) -> str:
    return formatted_number(ratio, 0, " %")
