"""The lines of a report's tables of detection, and the notes below them."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.records import SuccessRecord
from advpipe.pipeline.results.row import PLAIN_BASELINE, ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.condition_matches import WHOLE
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.report.numbers import (
    NOTHING,
    formatted_number,
    formatted_ratio,
    interval,
    interval_cell,
    short_name,
    shown_interval,
)
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import variations
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, OVERLAPS, WHITE_BOX, lost_means

CLEAN = "clean"

CAR = ("strict", "car")
"""Whose average precision stands beside the mAP."""

COLUMNS = (
    "attack", "mAP", "ratio %", "95 %", "loose ratio %", "car AP", "CD m²", "points", "lost", "new FP",
    "max shift m",
)  # fmt: skip

SIGNIFICANT = {
    True: " Significant: yes.",
    False: " Significant: no.",
    None: "",
}
"""The end of a note on an attack; without an interval nothing is said."""


def changed_percent(removed: int, added: int, moved: int, clean: int) -> str:
    """Points removed (−), added (+) and moved (~) in percent of all clean points."""
    changed = (("−", removed), ("+", added), ("~", moved))
    parts = [f"{sign}{100 * count / clean:.2f} %" for sign, count in changed if count and clean]
    return " ".join(parts) or NOTHING


def cells(row: ResultRow, baseline: str = "") -> dict[str, str]:
    """A line of the table by column: an attack, or one of its baselines by name."""
    made_by, metrics = row.attack, row.metrics_of(baseline)
    if metrics is None:
        return dict.fromkeys(COLUMNS, NOTHING)
    parts = [str(each) for each in (made_by.attack, made_by.recipe, made_by.value) if each not in (None, "")]
    parts += variations(made_by)
    return {
        "attack": f"  {baseline_title(baseline, made_by.baseline_tries)}" if baseline else " ".join(parts),
        "mAP": formatted_number(metrics.map_adv, 3),
        "ratio %": formatted_ratio(metrics.map_ratio_percent, row.clean.means["strict"].map_r40),
        "95 %": interval_cell(metrics.map_ratio_ci95, row.counts),
        "loose ratio %": formatted_ratio(metrics.map_loose_ratio_percent, row.clean.means["loose"].map_r40),
        "car AP": formatted_number(metrics.precisions.ap.get(CAR), 3),
        "CD m²": formatted_number(metrics.chamfer_distance_m2, 5),
        "points": changed_percent(
            metrics.points_removed, metrics.points_added, metrics.points_moved, row.counts.points_clean
        ),
        "lost": formatted_number(metrics.lost_objects, 0),
        "new FP": formatted_number(metrics.new_false_positives, 0),
        "max shift m": formatted_number(metrics.max_displacement_m, 3),
    }


def clean_cells(row: ResultRow, detector: str = "") -> dict[str, str]:
    """The line of the clean clouds."""
    mean_ap = row.clean.means["strict"].map_r40
    return dict.fromkeys(COLUMNS, NOTHING) | {
        "attack": f"{CLEAN}: {short_name(detector)}" if detector else CLEAN,
        "mAP": formatted_number(mean_ap, 3),
        "ratio %": formatted_ratio(100.0, mean_ap),
        "loose ratio %": formatted_ratio(100.0, row.clean.means["loose"].map_r40),
        "car AP": formatted_number(row.clean.precisions.ap.get(CAR), 3),
    }


def lines(report: Report, is_short: bool = False) -> list[dict[str, str]]:
    """The table's lines: the clean clouds where their figures change, each attack, its baselines.

    Of the baselines a short table has one draw anywhere and the one to beat.
    """
    table: list[dict[str, str]] = []
    clean: dict[str, str] = {}
    several = len({row.detector for row in report.results}) > 1
    for row in report.results:
        about = clean_cells(row, row.detector if several else "")
        if about != clean:
            clean = about
            table.append(clean)
        if row.attacked is not None:
            table.append(cells(row))
        names = list(row.baselines)
        shown = [name for name in names if not is_short or name in (PLAIN_BASELINE, row.strongest_baseline)]
        table += [cells(row, name) for name in shown]
    return table


def results_table(report: Report) -> Table:
    """All lines as a table of the page."""
    found = lines(report)
    return Table(
        "The detector on clean and attacked clouds, with random baselines of equal budget below each attack",
        COLUMNS,
        tuple(tuple(line[column] for column in COLUMNS) for line in found),
    )


def table_notes(report: Report) -> list[str]:
    """The notes below the table."""
    notes = []
    several = len({row.detector for row in report.results}) > 1
    for row in report.results:
        bag = f"{row.bag}, seen by {short_name(row.detector)}" if several else row.bag
        size = f"{counted(row.counts.frames, 'frame')}, {counted(row.counts.objects, 'object')}"
        inside = [name for name in row.boxes if name in row.counts.classes_in_map]
        outside = [name for name in row.boxes if name not in inside and row.boxes[name]]
        left_out = f", without {_with_boxes(row, outside)}" if outside else ""
        notes.append(" ".join([f"{bag}: {size}, mAP over {_with_boxes(row, inside)}{left_out}.", *row.notes]))
        strongest = row.strongest_baseline
        if strongest and (bounds := row.baselines[strongest].map_ratio_delta_points_ci95):
            delta = formatted_number(row.baselines[strongest].map_ratio_delta_points, 2)
            shown = shown_interval(bounds, row.counts)
            title = baseline_title(strongest, row.attack.baseline_tries)
            notes.append(
                f"{bag}: Δ of the mAP ratio to {title}: {delta} percentage points"
                f"{f', 95 % interval {interval(shown)}' if shown else ''}."
                f"{SIGNIFICANT[row.significant_vs_random]}"
            )
        notes += _lost_note(report, row, bag)
    if any(row.baselines for row in report.results):
        notes.append(ABOUT_BASELINES)
    if any(row.attacked for row in report.results):
        notes.append(WHITE_BOX)
    return notes


def _with_boxes(row: ResultRow, names: Sequence[str]) -> str:
    """Classes with their evaluated boxes, such as `car (812), truck (57)`."""
    return ", ".join(f"{name} ({row.boxes[name]:,})" for name in names)


def _lost_note(report: Report, row: ResultRow, bag: str) -> list[str]:
    """How many of the objects found on clean clouds the detector misses on attacked ones."""
    about = (row.bag, row.detector, "adv", EVERY_CLASS, WHOLE)
    found = [
        each
        for each in report.listed(SuccessRecord)
        if (each.bag, each.detector, each.condition, each.class_name, each.range) == about
    ]
    return [
        f"{bag}: of the objects found on the clean clouds, with a score of at least "
        f"{formatted_number(each.min_score, 2)}, the detector loses "
        f"{_share(each.strict_lost, each.strict_found_clean, each.strict_attack_success_percent)} at strict "
        f"overlap, {_share(each.lost, each.found_clean, each.attack_success_percent)} at "
        f"loose overlap ({OVERLAPS})."
        for each in found
    ]


def _share(lost: int, found: int, percent: float) -> str:
    return f"{formatted_number(lost, 0)} of {formatted_number(found, 0)} ({formatted_number(percent, 1)} %)"


def lost_of(report: Report) -> str:
    """The criterion for `lost` in the table of this report; rows of other frames may have another score."""
    scores = {row.counts.working_score for row in report.results}
    return lost_means(scores.pop() if len(scores) == 1 else None)


def clean_lines(report: Report) -> list[dict[str, str]]:
    """A line for each class: average precision on the clean clouds of the first bag, and by range."""
    if not report.results:
        return []
    first = report.results[0]
    found = {
        (each.class_name, each.criterion, each.by, each.stratum): each
        for each in report.average_precision
        if (each.bag, each.detector, each.condition) == (first.bag, first.detector, CLEAN)
        and each.by in ("", "range")
    }
    ranges = list(dict.fromkeys(stratum for _, _, by, stratum in found if by))
    return [
        {
            "class": name,
            "boxes": formatted_number(found[name, "strict", "", WHOLE].boxes, 0),
            "AP": formatted_number(found[name, "strict", "", WHOLE].ap_r40, 3),
            "95 %": interval_cell(found[name, "strict", "", WHOLE].ap_r40_ci95, first.counts, 2),
            "R11": formatted_number(found[name, "strict", "", WHOLE].ap_r11, 3),
            "BEV": formatted_number(found[name, "bev", "", WHOLE].ap_r40, 3),
            "loose": formatted_number(found[name, "loose", "", WHOLE].ap_r40, 3),
            **{_short(r): formatted_number(found[name, "strict", "range", r].ap_r40, 3) for r in ranges},
        }
        for name in dict.fromkeys(name for name, *_ in found)
    ]


def _short(stratum: str) -> str:
    return stratum.replace("over ", ">").removesuffix(" m")
