"""The table of a report: for the terminal, and its cells for the page."""

from __future__ import annotations

from typing import Literal

from rich import box
from rich.table import Table

from advpipe.pipeline.core.streams import plain_console
from advpipe.pipeline.results.records import DefenceRecord, SuccessRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.condition import WHOLE
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number, interval, short_name
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.wording import OVERLAPS, PLAIN_RANDOM, RANDOM_BEST, WHITE_BOX, lost_means

CLEAN = "clean"
MIN_TITLE = 16

CAR = ("strict", "car")
"""Whose average precision stands beside the mAP."""

COLUMNS = (
    "attack", "mAP", "ratio %", "95 %", "car AP", "CD m²", "points", "lost", "new FP", "max shift m",
)  # fmt: skip
ON_THE_TERMINAL = ("attack", "mAP", "ratio %", "95 %", "car AP", "CD m²", "points", "lost")
"""The columns that fit into 80 characters; the page has them all."""


def changed_percent(removed: int, added: int, moved: int, clean: int) -> str:
    """Points removed (−), added (+) and moved (~) in percent of all clean points."""
    changed = (("−", removed), ("+", added), ("~", moved))
    words = [f"{sign}{100 * count / clean:.2f} %" for sign, count in changed if count and clean]
    return " ".join(words) or NOTHING


def cells(row: ResultRow, baseline: str = "") -> dict[str, str]:
    """A line of the table by column: an attack, or a baseline of it by its word."""
    made_by, figures = row.attack, row.figures_of(baseline)
    if figures is None:
        return dict.fromkeys(COLUMNS, NOTHING)
    words = [str(each) for each in (made_by.attack, made_by.recipe, made_by.value) if each not in (None, "")]
    return {
        "attack": f"  {baseline_title(baseline)}" if baseline else " ".join(words),
        "mAP": formatted_number(figures.map_adv, 3),
        "ratio %": formatted_number(figures.map_ratio_percent, 2),
        "95 %": interval(figures.map_ratio_ci95),
        "car AP": formatted_number(figures.precisions.ap.get(CAR), 3),
        "CD m²": formatted_number(figures.chamfer_distance_m2, 5),
        "points": changed_percent(
            figures.points_removed, figures.points_added, figures.points_moved, row.counts.points_clean
        ),
        "lost": formatted_number(figures.lost_objects, 0),
        "new FP": formatted_number(figures.new_false_positives, 0),
        "max shift m": formatted_number(figures.max_displacement_m, 3),
    }


def defended_cells(defended: DefenceRecord) -> dict[str, str]:
    """The line of an attack under a defence."""
    attacked = defended.attacked
    return dict.fromkeys(COLUMNS, NOTHING) | {
        "attack": f"  under {defended.defence}",
        "mAP": formatted_number(attacked and attacked.map_adv, 3),
        "ratio %": formatted_number(attacked and attacked.map_ratio_percent, 2),
        "95 %": interval(attacked and attacked.map_ratio_ci95),
        "car AP": formatted_number(attacked and attacked.precisions.ap.get(CAR), 3),
    }


def clean_cells(row: ResultRow, detector: str = "") -> dict[str, str]:
    """The line of the clean clouds."""
    return dict.fromkeys(COLUMNS, NOTHING) | {
        "attack": f"{CLEAN}: {short_name(detector)}" if detector else CLEAN,
        "mAP": formatted_number(row.clean.means["strict"].map_r40, 3),
        "ratio %": formatted_number(100.0, 2),
        "car AP": formatted_number(row.clean.precisions.ap.get(CAR), 3),
    }


def lines(report: Report, is_short: bool = False) -> list[dict[str, str]]:
    """The table's lines: the clean clouds where their figures change, each attack, baselines, defences.

    Of the baselines a short table has the plain one and the strongest.
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
        words = list(row.baselines)
        shown = [word for word in words if not is_short or word in (words[0], row.strongest_baseline)]
        table += [cells(row, word) for word in shown]
        table += [
            defended_cells(each)
            for each in report.listed(DefenceRecord)
            if (each.bag, each.detector) == (row.bag, row.detector)
        ]
    return table


def report_warnings(report: Report) -> list[str]:
    """What must be known beside the table."""
    words = []
    several = len({row.detector for row in report.results}) > 1
    for row in report.results:
        bag = f"{row.bag}, seen by {short_name(row.detector)}" if several else row.bag
        size = f"{row.counts.frames} frames, {row.counts.objects} objects"
        classes = ", ".join(row.counts.classes_in_map)
        words.append(" ".join([f"{bag}: {size}, mAP over {classes}.", *row.notes]))
        strongest = row.strongest_baseline
        if strongest and (bounds := row.baselines[strongest].map_ratio_delta_points_ci95):
            words.append(
                f"{bag}: mAP ratio minus that {baseline_title(strongest)} (the strongest {PLAIN_RANDOM} "
                f"baseline) {formatted_number(row.baselines[strongest].map_ratio_delta_points, 2)} points, "
                f"95 % interval {interval(bounds)}. Beats {PLAIN_RANDOM}: "
                f"{'yes' if row.significant_vs_random else 'no'}."
            )
        words += _lost_remark(report, row, bag)
    if any(row.baselines for row in report.results):
        words.append(RANDOM_BEST)
    if any(row.attacked for row in report.results):
        words.append(WHITE_BOX)
    return words


def _lost_remark(report: Report, row: ResultRow, bag: str) -> list[str]:
    """How many objects an attack makes the detector lose, at both overlaps."""
    about = (row.bag, row.detector, "adv", EVERY_CLASS, WHOLE)
    found = [
        each
        for each in report.listed(SuccessRecord)
        if (each.bag, each.detector, each.condition, each.class_name, each.range) == about
    ]
    return [
        f"{bag}: lost of the objects found on the clean clouds, with a score of at least "
        f"{formatted_number(each.min_score, 2)}: "
        f"{_share(each.strict_lost, each.strict_found_clean, each.strict_attack_success_percent)} at strict "
        f"overlap, {_share(each.lost, each.found_clean, each.attack_success_percent)} at "
        f"loose overlap ({OVERLAPS})."
        for each in found
    ]


def _share(lost: int, found: int, percent: float) -> str:
    return f"{formatted_number(lost, 0)} of {formatted_number(found, 0)} ({formatted_number(percent, 1)} %)"


def lost_of(report: Report) -> str:
    """What `lost` means in the table of this report; rows on other frames may have another score."""
    scores = {row.counts.working_score for row in report.results}
    return lost_means(scores.pop() if len(scores) == 1 else None)


def clean_lines(report: Report) -> list[dict[str, str]]:
    """A line a class: average precision on the clean clouds of the first bag, and by range."""
    if not report.results:
        return []
    bag, detector = report.results[0].bag, report.results[0].detector
    found = {
        (each.class_name, each.criterion, each.by, each.stratum): each
        for each in report.average_precision
        if (each.bag, each.detector, each.condition) == (bag, detector, CLEAN) and each.by in ("", "range")
    }
    ranges = list(dict.fromkeys(stratum for _, _, by, stratum in found if by))
    return [
        {
            "class": name,
            "boxes": formatted_number(found[name, "strict", "", WHOLE].boxes, 0),
            "AP": formatted_number(found[name, "strict", "", WHOLE].ap_r40, 3),
            "95 %": interval(found[name, "strict", "", WHOLE].ap_r40_ci95, 2),
            "R11": formatted_number(found[name, "strict", "", WHOLE].ap_r11, 3),
            "BEV": formatted_number(found[name, "bev", "", WHOLE].ap_r40, 3),
            "loose": formatted_number(found[name, "loose", "", WHOLE].ap_r40, 3),
            **{_short(r): formatted_number(found[name, "strict", "range", r].ap_r40, 3) for r in ranges},
        }
        for name in dict.fromkeys(name for name, *_ in found)
    ]


def _short(stratum: str) -> str:
    return stratum.replace("over ", ">").removesuffix(" m")


def print_report(report: Report) -> None:
    """The tables on the terminal: the detector on the clean clouds, then attacks if there are any."""
    console = plain_console()
    for banner in report.warnings:
        console.print(banner, style="bold yellow", highlight=False, markup=False)
    if by_class := clean_lines(report):
        console.print(_by_class(by_class))
    if any(row.attacked for row in report.results):
        console.print(_by_attack(report, console.width))
    elif report.results:
        clean = report.results[0].clean
        found = clean.precisions.ap
        car = f"; car alone {formatted_number(found[CAR], 3)}" if CAR in found else ""
        console.print(f"mAP {formatted_number(clean.means['strict'].map_r40, 3)}{car}", highlight=False)
    for remark in report_warnings(report):
        console.print(remark, highlight=False, markup=False)
    for section in report.sections:
        for note in section.notes:
            console.print(note, highlight=False, markup=False)


def _by_class(lines: list[dict[str, str]]) -> Table:
    table = Table(
        title="Clean clouds: strict 3D AP R40; R11; bird's-eye; loose 3D; strict 3D by range",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for column in lines[0]:
        table.add_column(column, justify="left" if column == "class" else "right", no_wrap=True)
    for line in lines:
        table.add_row(*line.values())
    return table


def _by_attack(report: Report, width_characters: int) -> Table:
    table = Table(
        title="Detection: strict 3D R40 average precision, ratio to clean, Chamfer distance;\n"
        f"lost: found on the clean cloud and missed, {lost_of(report)}",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    shown = lines(report, is_short=True)
    widths = {
        column: max(len(line[column]) for line in (*shown, {column: column})) for column in ON_THE_TERMINAL
    }
    rest = sum(width + 2 for column, width in widths.items() if column != "attack")
    widths["attack"] = max(
        min(widths["attack"], width_characters - rest - 2), MIN_TITLE
    )  # cut off if too long
    for column, width in widths.items():
        justify: Literal["left", "right"] = "left" if column == "attack" else "right"
        table.add_column(column, justify=justify, no_wrap=True, width=width)
    for line in shown:
        style = "dim" if line["attack"].startswith((CLEAN, " ")) else None
        table.add_row(*(line[column] for column in ON_THE_TERMINAL), style=style)
    return table
