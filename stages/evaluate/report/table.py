"""The table of a report: for the terminal, and its cells for the page."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from advpipe.stages.evaluate.detection.arm import WHOLE
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.report.numbers import NOTHING, interval, number
from advpipe.stages.evaluate.report.report import Report

CLEAN, AT_RANDOM = "clean", "  at random"

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
    """A line of the table by column: an attack (no prefix) or its baseline (`baseline_`)."""
    words = [str(row[key]) for key in ("attack", "recipe", "value") if row[key] is not None]
    return {
        "attack": AT_RANDOM if prefix else " ".join(words),
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


def clean_cells(row: Row) -> dict[str, str]:
    """The line of the clean clouds."""
    empty = dict.fromkeys(cells(row), NOTHING)
    return empty | {
        "attack": CLEAN,
        "mAP": number(row["map_clean"], 3),
        "ratio %": number(100.0, 2),
        "car AP": number(row.get("ap_car_clean"), 3),
    }


def lines(report: Report) -> list[dict[str, str]]:
    """The table's lines: the clean clouds wherever their figures change, each attack, its baseline."""
    table: list[dict[str, str]] = []
    clean: dict[str, str] = {}
    for row in report.rows:
        if clean_cells(row) != clean:
            clean = clean_cells(row)
            table.append(clean)
        if row["map_adv"] is not None:
            table.append(cells(row))
        if row["baseline_map_adv"] is not None:
            table.append(cells(row, "baseline_"))
    return table


def remarks(report: Report) -> list[str]:
    """What must be known beside the table."""
    words = []
    for row in report.rows:
        chosen, notes = row["classes_in_map"], row["notes"]
        if isinstance(chosen, list) and isinstance(notes, list):
            size = f"{row['frames']} frames, {row['objects']} objects"
            words.append(" ".join([f"{row['bag']}: {size}, mAP over {', '.join(chosen)}.", *notes]))
        difference = row["map_ratio_minus_baseline_ci95"]
        if isinstance(difference, tuple):
            words.append(
                f"{row['bag']}: mAP ratio minus that at random {number(row['map_ratio_minus_baseline'], 2)} "
                f"points, 95 % interval {interval(difference)}."
            )
    return words


def clean_lines(report: Report) -> list[dict[str, str]]:
    """A line a class: average precision on the clean clouds of the first bag, and by range."""
    bag = report.rows[0]["bag"]
    found = {
        (each["class"], each["criterion"], each["by"], each["stratum"]): each
        for each in report.average_precision
        if each["bag"] == bag and each["cloud"] == "clean" and each["by"] in ("", "range")
    }
    ranges = list(dict.fromkeys(stratum for _, _, by, stratum in found if by))
    return [
        {
            "class": str(name),
            "boxes": number(found[name, "strict", "", WHOLE]["boxes"], 0),
            "AP": number(found[name, "strict", "", WHOLE]["ap_r40"], 3),
            "95 %": interval(found[name, "strict", "", WHOLE]["ap_r40_ci95"], 2),
            "R11": number(found[name, "strict", "", WHOLE]["ap_r11"], 3),
            "BEV": number(found[name, "bev", "", WHOLE]["ap_r40"], 3),
            "loose": number(found[name, "loose", "", WHOLE]["ap_r40"], 3),
            **{_short(r): number(found[name, "strict", "range", r]["ap_r40"], 3) for r in ranges},
        }
        for name in dict.fromkeys(name for name, *_ in found)
    ]


def _short(stratum: object) -> str:
    return str(stratum).replace("over ", ">").removesuffix(" m")


def print_report(report: Report) -> None:
    """The tables on the terminal: the detector on the clean clouds, then attacks if there are any."""
    console = Console()
    if by_class := clean_lines(report):
        console.print(_by_class(by_class))
    if any(row["map_adv"] is not None for row in report.rows):
        console.print(_by_attack(report))
    else:
        row = report.rows[0]
        car = f"; car alone {number(row['ap_car_clean'], 3)}" if "ap_car_clean" in row else ""
        console.print(f"mAP {number(row['map_clean'], 3)}{car}", highlight=False)
    for remark in remarks(report):
        console.print(remark, highlight=False, markup=False)


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


def _by_attack(report: Report) -> Table:
    table = Table(
        title="Detection: strict 3D R40 average precision, ratio to clean, Chamfer distance",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    for column in ON_THE_TERMINAL:
        table.add_column(column, justify="left" if column == "attack" else "right", no_wrap=True)
    for line in lines(report):
        style = "dim" if line["attack"] in (CLEAN, AT_RANDOM) else None
        table.add_row(*(line[column] for column in ON_THE_TERMINAL), style=style)
    return table
