"""The table of a report: for the terminal, and its cells for the page."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table

from advpipe.stages.evaluate.detection.summary import Row
from advpipe.stages.evaluate.report.report import Report

NOTHING = "–"
CLEAN, AT_RANDOM = "clean", "  at random"

ON_THE_TERMINAL = ("attack", "mAP", "ratio %", "95 %", "car AP", "CD m²", "points", "lost")
"""The columns that fit into 80 characters; the page has them all."""


def number(value: object, digits: int, suffix: str = "") -> str:
    """A figure with so many digits after the point; a dash for one that is undefined."""
    if not isinstance(value, float | int) or value != value:
        return NOTHING
    return f"{value:,.{digits}f}{suffix}"


def interval(value: object) -> str:
    """Such as `40.1…52.3`; a dash where there is none."""
    return f"{value[0]:.1f}…{value[1]:.1f}" if isinstance(value, tuple) else NOTHING


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


def print_report(report: Report) -> None:
    """The table on the terminal."""
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
    console = Console()
    console.print(table)
    for remark in remarks(report):
        console.print(remark, highlight=False, markup=False)
