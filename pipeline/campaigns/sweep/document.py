"""The report of a sweep: on the terminal, as report.json and as a page that needs no other file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.campaigns.sweep.budgets import AXES
from advpipe.pipeline.campaigns.sweep.caveats import sweep_caveats
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.curves import draw_convergence, draw_sweep_curves
from advpipe.pipeline.campaigns.sweep.ingredients import ingredients_tables, measured
from advpipe.pipeline.campaigns.sweep.listed_tables import listed_tables
from advpipe.pipeline.campaigns.sweep.loose_tables import hidden_table, loose_table
from advpipe.pipeline.campaigns.sweep.tables import (
    ON_THE_TERMINAL,
    baselines_table,
    budget_table,
    convergence_table,
    paper_tables,
    records,
    seeds_table,
    table_one,
    table_two,
)
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.html_page import rendered
from advpipe.pipeline.results.deprecated import with_deprecated_keys
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.report import FORMULAS
from advpipe.stages.evaluate.report.section import OVERVIEW, ReportPicture, Table

TEMPLATE = Path(__file__).with_name("sweep.html")


def write_document(
    folder: Path,
    cells: Sequence[Cell],
    recipes: Sequence[str],
    command: str,
    panels: Sequence[ReportPicture] = (),
    warnings: Sequence[str] = (),
) -> None:
    """Write report.json, report.html and figures/ of all cells; those of an earlier run are replaced.

    command: that made them. panels: pictures of a frame, if they were drawn. warnings: what must be read
    before any value.
    """
    pictures = [*panels, *_curves(cells)]
    (folder / "figures").mkdir(exist_ok=True)
    for picture in pictures:
        write_atomically(folder / "figures" / picture.file_name, picture.png)
    write_atomically(folder / "report.json", to_json(cells, recipes, command, warnings).encode())
    write_atomically(folder / "report.html", _html(cells, recipes, command, pictures, warnings).encode())


def _curves(cells: Sequence[Cell]) -> list[ReportPicture]:
    caption = "mAP ratio over budget and over Chamfer distance, with 95 % intervals: "
    pictures = [
        ReportPicture(
            OVERVIEW, "", f"{attack}.png", caption + axis.title, to_png(draw_sweep_curves(cells, attack))
        )
        for attack, axis in AXES.items()
    ]
    if (figure := draw_convergence(cells)) is not None:
        title = "More steps: mAP ratio over the number of steps, with 95 % intervals"
        pictures.append(ReportPicture(OVERVIEW, "", "convergence.png", title, to_png(figure)))
    return pictures


def to_json(cells: Sequence[Cell], recipes: Sequence[str], command: str, warnings: Sequence[str] = ()) -> str:
    """The text of report.json."""
    formulas = {key: FORMULAS[key] for key in _SHOWN}
    document: dict[str, Any] = {
        "warnings": list(warnings),
        "command": command,
        "formulas": formulas,
        "caveats": sweep_caveats(cells),
        "provenance": provenance(cells),
        "cells": records(cells, recipes),
        "ingredients": measured(cells),
    }
    return json.dumps(with_deprecated_keys(document), indent=1, sort_keys=True, allow_nan=False) + "\n"


def provenance(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """What made the cells of each recipe: settings, commits, the list of frames, and the bags' checksums."""
    by_recipe: dict[str, list[Cell]] = {}
    for cell in cells:
        by_recipe.setdefault(cell.recipe, []).append(cell)
    return [
        {
            "recipe": recipe,
            **vars(group[0].settings),
            "commits": sorted({cell.commit for cell in group if cell.commit}),
            "frame_list": list(group[0].frames),
            "bags_sha256": {cell.budget: cell.bag_sha256 for cell in group},
        }
        for recipe, group in by_recipe.items()
    ]


def _html(
    cells: Sequence[Cell],
    recipes: Sequence[str],
    command: str,
    pictures: Sequence[ReportPicture],
    warnings: Sequence[str],
) -> str:
    details = (
        seeds_table(cells),
        *(baselines_table(cells), loose_table(cells), hidden_table(cells)),
        *(budget_table(cells), convergence_table(cells)),
        *listed_tables(cells),
        *ingredients_tables(cells),
    )
    return rendered(
        TEMPLATE.read_text(encoding="utf-8"),
        title="The paper's tables",
        warnings=warnings,
        caveats=sweep_caveats(cells),
        tables=paper_tables(cells, recipes),
        details=[table for table in details if table.lines],
        pictures=pictures,
        formulas={key: FORMULAS[key] for key in _SHOWN},
        command=command,
        provenance=json.dumps(provenance(cells), indent=1, sort_keys=True),
    )


_SHOWN = (
    *("ap", "map", "map_ratio", "iou", "ignored", "chamfer", "interval", "baseline", "significant_vs_random"),
    *("lost", "white_box"),
)


def print_document(cells: Sequence[Cell], recipes: Sequence[str], warnings: Sequence[str] = ()) -> None:
    """Both tables on the terminal; of Table II the columns that fit there."""
    from advpipe.pipeline.core.streams import plain_console

    console = plain_console()
    for warning in warnings:
        console.print(warning, style="bold yellow", highlight=False, markup=False)
    for recipe in recipes:  # one table each: side by side they are too wide
        console.print(rich_table(_transposed(table_one(cells, [recipe]))))
    for attack in AXES:
        table = table_two(cells, recipes, attack)
        lines = tuple(tuple(line[place] for place in ON_THE_TERMINAL) for line in table.lines)
        console.print(rich_table(Table(table.title, tuple(ON_THE_TERMINAL.values()), lines)))
    if (of_seeds := seeds_table(cells)).lines:
        console.print(rich_table(of_seeds))
    for caveat in sweep_caveats(cells):
        console.print(caveat, highlight=False, markup=False)


def _transposed(table: Table) -> Table:
    """A line for each column: there may be many recipes' lines, but they are too wide for a terminal."""
    columns = list(zip(table.heads, *table.lines, strict=True))
    return Table(table.title, columns[0], tuple(columns[1:]))


def rich_table(table: Table) -> Any:
    """The table for a terminal."""
    from rich import box
    from rich.table import Table as RichTable

    shown = RichTable(
        title=table.title, title_justify="left", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0)
    )
    for place, head in enumerate(table.heads):
        shown.add_column(head, justify="right" if place else "left")
    for line in table.lines:
        shown.add_row(*line)
    return shown
