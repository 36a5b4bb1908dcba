"""The table of a report: for the terminal, and its cells for the page."""

from __future__ import annotations

from typing import Literal

from rich import box
from rich.table import Table

from advpipe.pipeline.core.streams import plain_console
from advpipe.stages.evaluate.detection.arm import WHOLE
from advpipe.stages.evaluate.detection.baseline import baseline_title
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.detection.success import EVERY_CLASS
from advpipe.stages.evaluate.report.numbers import NOTHING, interval, number, short_name
from advpipe.stages.evaluate.report.ratios import strongest_baseline
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.wording import OVERLAPS, PLAIN_RANDOM, RANDOM_BEST, WHITE_BOX, lost_means

CLEAN = "clean"
MIN_TITLE = 16

ON_THE_TERMINAL = ("attack", "mAP", "ratio %", "95 %", "car AP", "CD m²", "points", "lost")
"""The columns that fit into 80 characters; the page has them all."""


def changed_points(row: Row, prefix: str = "") -> str:
    """Points removed (−), added (+) and moved (~) in percent of all clean points."""
    words = []
    for sign, name in (("−", "removed"), ("+", "added"), ("~", "moved")):
        count, clean = row[f"{prefix}points_{name}"], row["points_clean"]
        if isinstance(count, int) and isinstance(clean, int) and count and clean:
            words.append(f"{sign}{100 * count / clean:.2f} %")
    return " ".join(words) or NOTHING


def cells(row: Row, prefix: str = "") -> dict[str, str]:
    """A line of the table by column: an attack (no prefix) or a baseline of it (its word before `_`)."""
    words = [str(row[key]) for key in ("attack", "recipe", "value") if row[key] not in (None, "")]
    return {
        "attack": f"  {baseline_title(prefix.removesuffix('_'))}" if prefix else " ".join(words),
        "mAP": number(row[f"{prefix}map_adv"], 3),
        "ratio %": number(row[f"{prefix}map_ratio_percent"], 2),
        "95 %": interval(row[f"{prefix}map_ratio_ci95"]),
        "car AP": number(row.get(f"{prefix}ap_car_adv"), 3),
        "CD m²": number(row[f"{prefix}chamfer_distance_m2"], 5),
        "points": changed_points(row, prefix),
        "lost": number(row[f"{prefix}lost_objects"], 0),
        "new FP": number(row[f"{prefix}new_false_positives"], 0),
        "max shift m": number(row[f"{prefix}max_displacement_m"], 3),
    }


def defended_cells(row: Row, defended: Row) -> dict[str, str]:
    """The line of an attack under a defence."""
    return dict.fromkeys(cells(row), NOTHING) | {
        "attack": f"  under {defended['defence']}",
        "mAP": number(defended.get("map_adv"), 3),
        "ratio %": number(defended.get("map_ratio_percent"), 2),
        "95 %": interval(defended.get("map_ratio_ci95")),
        "car AP": number(defended.get("ap_car_adv"), 3),
    }


def clean_cells(row: Row, detector: str = "") -> dict[str, str]:
    """The line of the clean clouds."""
    empty = dict.fromkeys(cells(row), NOTHING)
    return empty | {
        "attack": f"{CLEAN}: {short_name(detector)}" if detector else CLEAN,
        "mAP": number(row["map_clean"], 3),
        "ratio %": number(100.0, 2),
        "car AP": number(row.get("ap_car_clean"), 3),
    }


def lines(report: Report, is_short: bool = False) -> list[dict[str, str]]:
    """The table's lines: the clean clouds where their figures change, each attack, baselines, defences.

    Of the baselines a short table has the plain one and the strongest.
    """
    table: list[dict[str, str]] = []
    clean: dict[str, str] = {}
    several = len({row["detector"] for row in report.rows}) > 1
    for row in report.rows:
        about = clean_cells(row, str(row["detector"]) if several else "")
        if about != clean:
            clean = about
            table.append(clean)
        if row["map_adv"] is not None:
            table.append(cells(row))
        words = row["baselines"] if isinstance(row["baselines"], list) else []
        shown = [word for word in words if not is_short or word in (words[0], strongest_baseline(row))]
        table += [cells(row, f"{word}_") for word in shown]
        table += [defended_cells(row, each) for each in _defended(report, row)]
    return table


def _defended(report: Report, row: Row) -> list[Row]:
    records = next((section.records for section in report.sections if section.key == "defences"), ())
    return [each for each in records if all(each[key] == row[key] for key in ("bag", "detector"))]


def remarks(report: Report) -> list[str]:
    """What must be known beside the table."""
    words = []
    several = len({row["detector"] for row in report.rows}) > 1
    for row in report.rows:
        bag = f"{row['bag']}, seen by {short_name(row['detector'])}" if several else str(row["bag"])
        chosen, notes = row["classes_in_map"], row["notes"]
        if isinstance(chosen, list) and isinstance(notes, list):
            size = f"{row['frames']} frames, {row['objects']} objects"
            words.append(" ".join([f"{bag}: {size}, mAP over {', '.join(chosen)}.", *notes]))
        if (strongest := strongest_baseline(row)) and row[f"map_ratio_minus_{strongest}_ci95"]:
            words.append(
                f"{bag}: mAP ratio minus that {baseline_title(strongest)} (the strongest {PLAIN_RANDOM} "
                f"baseline) {number(row[f'map_ratio_minus_{strongest}'], 2)} points, 95 % interval "
                f"{interval(row[f'map_ratio_minus_{strongest}_ci95'])}. "
                f"Beats {PLAIN_RANDOM}: {'yes' if row['beats_random'] else 'no'}."
            )
        words += _lost_remark(report, row, bag)
    if any(row["baselines"] for row in report.rows):
        words.append(RANDOM_BEST)
    if any(row["map_adv"] is not None for row in report.rows):
        words.append(WHITE_BOX)
    return words


def _lost_remark(report: Report, row: Row, bag: str) -> list[str]:
    """How many objects an attack makes the detector lose, at both overlaps."""
    records = next((section.records for section in report.sections if section.key == "attack_success"), ())
    about = {"cloud": "adv", "class": EVERY_CLASS, "range": WHOLE}
    about |= {key: str(row[key]) for key in ("bag", "detector")}
    return [
        f"{bag}: lost of the objects found on the clean clouds, with a score of at least "
        f"{number(each['min_score'], 2)}: {_share(each, 'strict_')} at strict overlap, {_share(each)} at "
        f"loose overlap ({OVERLAPS})."
        for each in records
        if all(each[key] == value for key, value in about.items())
    ]


def _share(record: Row, prefix: str = "") -> str:
    lost, found = record[f"{prefix}lost"], record[f"{prefix}found_clean"]
    percent = number(record[f"{prefix}attack_success_percent"], 1)
    return f"{number(lost, 0)} of {number(found, 0)} ({percent} %)"


def lost_of(report: Report) -> str:
    """What `lost` means in the table of this report; rows on other frames may have another score."""
    scores = {row["working_score"] for row in report.rows}
    return lost_means(scores.pop() if len(scores) == 1 else None)


def clean_lines(report: Report) -> list[dict[str, str]]:
    """A line a class: average precision on the clean clouds of the first bag, and by range."""
    if not report.results:
        return []
    bag, detector = report.results[0].bag, report.results[0].detector
    found = {
        (each.class_name, each.criterion, each.by, each.stratum): each
        for each in report.average_precision
        if (each.bag, each.detector, each.cloud) == (bag, detector, CLEAN) and each.by in ("", "range")
    }
    ranges = list(dict.fromkeys(stratum for _, _, by, stratum in found if by))
    return [
        {
            "class": name,
            "boxes": number(found[name, "strict", "", WHOLE].boxes, 0),
            "AP": number(found[name, "strict", "", WHOLE].ap_r40, 3),
            "95 %": interval(found[name, "strict", "", WHOLE].ap_r40_ci95, 2),
            "R11": number(found[name, "strict", "", WHOLE].ap_r11, 3),
            "BEV": number(found[name, "bev", "", WHOLE].ap_r40, 3),
            "loose": number(found[name, "loose", "", WHOLE].ap_r40, 3),
            **{_short(r): number(found[name, "strict", "range", r].ap_r40, 3) for r in ranges},
        }
        for name in dict.fromkeys(name for name, *_ in found)
    ]


def _short(stratum: str) -> str:
    return stratum.replace("over ", ">").removesuffix(" m")


def print_report(report: Report) -> None:
    """The tables on the terminal: the detector on the clean clouds, then attacks if there are any."""
    console = plain_console()
    for banner in report.banners:
        console.print(banner, style="bold yellow", highlight=False, markup=False)
    if by_class := clean_lines(report):
        console.print(_by_class(by_class))
    if any(row["map_adv"] is not None for row in report.rows):
        console.print(_by_attack(report, console.width))
    elif report.rows:
        row = report.rows[0]
        car = f"; car alone {number(row['ap_car_clean'], 3)}" if "ap_car_clean" in row else ""
        console.print(f"mAP {number(row['map_clean'], 3)}{car}", highlight=False)
    for remark in remarks(report):
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
