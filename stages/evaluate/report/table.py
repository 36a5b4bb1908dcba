"""The table of a report: for the terminal, and its cells for the page."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from advpipe.stages.evaluate.detection.summary import Row
from advpipe.stages.evaluate.report.report import Report

NOTHING = "–"


def number(value: object, digits: int, suffix: str = "") -> str:
    """A figure with so many digits after the point; a dash for one that is undefined."""
    if not isinstance(value, float | int) or value != value:
        return NOTHING
    return f"{value:,.{digits}f}{suffix}"


def interval(value: object, digits: int = 1) -> str:
    """Such as `40.1 … 52.3`; a dash where there is none."""
    return f"{value[0]:.{digits}f} … {value[1]:.{digits}f}" if isinstance(value, tuple) else NOTHING


def share(count: object, whole: object) -> str:
    """A count of points in percent of all clean points; a dash for none."""
    if not isinstance(count, int) or not isinstance(whole, int) or not count or not whole:
        return NOTHING
    return f"{100 * count / whole:.2f} %"


def cells(row: Row, prefix: str = "") -> dict[str, str]:
    """A line of the table by column: an attack (no prefix) or its baseline (`baseline_`)."""
    return {
        "attack": "  at random" if prefix else str(row["attack"]),
        "recipe": NOTHING if prefix else str(row["recipe"] or NOTHING),
        "budget": NOTHING if prefix or not row["parameter"] else f"{row['parameter']} {row['value']}",
        "mAP": number(row[f"{prefix}map_adv"], 3),
        "mAP ratio %": number(row[f"{prefix}map_ratio_percent"], 2),
        "95 % interval": interval(row[f"{prefix}map_ratio_ci95"]),
        "car AP": number(row.get(f"{prefix}ap_car_adv"), 3),
        "CD m²": number(row[f"{prefix}chamfer_distance_m2"], 5),
        "max shift m": number(row[f"{prefix}max_displacement_m"], 3),
        "removed": share(row[f"{prefix}points_removed"], row["points_clean"]),
        "added": share(row[f"{prefix}points_added"], row["points_clean"]),
        "lost": number(row[f"{prefix}lost_objects"], 0),
        "new FP": number(row[f"{prefix}new_false_positives"], 0),
    }


def clean_cells(row: Row) -> dict[str, str]:
    """The line of the clean clouds."""
    empty = dict.fromkeys(cells(row), NOTHING)
    return empty | {
        "attack": "clean",
        "mAP": number(row["map_clean"], 3),
        "mAP ratio %": number(100.0, 2),
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
    """What must be known beside the table, each once."""
    words = []
    for row in report.rows:
        chosen, notes = row["classes_in_map"], row["notes"]
        if isinstance(chosen, list) and isinstance(notes, list):
            size = f"{row['frames']} frames, {row['objects']} objects"
            words += [f"{row['bag']}: {size}, mAP over {', '.join(chosen)}.", *notes]
        difference = row["map_ratio_minus_baseline_ci95"]
        if isinstance(difference, tuple):
            words.append(
                f"{row['bag']}: mAP ratio minus that at random {number(row['map_ratio_minus_baseline'], 2)} "
                f"points, 95 % interval {interval(difference)}."
            )
    return list(dict.fromkeys(words))


def print_report(report: Report) -> None:
    """The table on the terminal."""
    table = Table(title="Detection, strict 3D R40", title_justify="left", header_style="bold")
    rows = lines(report)
    for column in rows[0]:
        table.add_column(column, justify="left" if column in ("attack", "recipe", "budget") else "right")
    for row in rows:
        table.add_row(*row.values(), style="dim" if row["attack"] in ("clean", "  at random") else None)
    console = Console()
    console.print(table)
    for remark in remarks(report):
        console.print(remark, highlight=False, markup=False)
