"""A report on the terminal: warnings, tables that fit its width, and notes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from rich import box
from rich.table import Table as RichTable

from advpipe.pipeline.core.streams import plain_console
from advpipe.stages.evaluate.report.numbers import (
    NO_INTERVAL,
    NOT_MEANINGFUL,
    NOTHING,
    UNDEFINED_RATIO,
    formatted_number,
)
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.table import CAR, CLEAN, clean_lines, lines, lost_of, table_notes
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, OVERLAPS, WHITE_BOX

COLUMNS = ("attack", "mAP", "ratio %", "95 %", "loose ratio %", "CD m²", "points", "lost")
"""The columns of the page's table of attacks that fit into 80 characters."""

INTERVAL = "95 %"
"""A column that is left out where no line has an interval."""

MIN_TITLE = 16

SHORT_BASELINES = "The baseline to beat is random-best; the other random baselines are one draw each."
SHORT_WHITE_BOX = (
    "The attacker knows the detector, the true boxes (with --truth detections: what it finds in the clean "
    "cloud), and the rule that matches detections to them."
)


def print_report(report: Report) -> None:
    """Print the warnings, the notes and the tables of a report; the tables come last, where people look.

    The tables are the detector's results on the clean clouds, those on attacked clouds if there are any,
    and the main values of each section that a family of attacks adds. Of what every report says of its
    baselines and attackers there is one line; the page has it in full.
    """
    console = plain_console()
    for warning in report.warnings:
        console.print(warning, style="bold yellow", highlight=False, markup=False)
    for note in _notes(report):
        console.print(note, highlight=False, markup=False)
    if by_class := clean_lines(report):
        console.print(terminal_table(_clean_table(by_class), console.width))
    if any(row.attacked for row in report.results):
        console.print(terminal_table(_attack_table(report), console.width))
    elif report.results:
        clean = report.results[0].clean
        found = clean.precisions.ap
        car = f"; car alone {formatted_number(found[CAR], 3)}" if CAR in found else ""
        console.print(f"mAP {formatted_number(clean.means['strict'].map_r40, 3)}{car}", highlight=False)
    for section in report.sections:
        for note in section.notes:
            console.print(note, highlight=False, markup=False)
        for table in section.terminal:
            console.print(terminal_table(table, console.width))


def _notes(report: Report) -> list[str]:
    """The notes of the page's table, shorter."""
    notes = [note.replace(f" ({OVERLAPS})", "") for note in table_notes(report)]
    short = {ABOUT_BASELINES: SHORT_BASELINES, WHITE_BOX: SHORT_WHITE_BOX}
    return [short.get(note, note) for note in notes]


def _clean_table(by_class: Sequence[dict[str, str]]) -> Table:
    title = "Clean clouds: strict 3D AP R40; R11; bird's-eye; loose 3D; strict 3D by range"
    return _table(title, tuple(by_class[0]), by_class)


def _attack_table(report: Report) -> Table:
    title = (
        "Detection: strict 3D R40 average precision, ratio to clean, Chamfer distance; "
        f"lost: found on the clean cloud and missed, {lost_of(report)}"
    )
    return _table(title, COLUMNS, lines(report, is_short=True))


def _table(title: str, columns: Sequence[str], found: Sequence[dict[str, str]]) -> Table:
    """Some columns of these lines; notes say in words what is short here."""
    shown = [
        {column: _short(line[column]) if column != columns[0] else line[column] for column in columns}
        for line in found
    ]
    kept = [c for c in columns if c != INTERVAL or any(line[c] != NOTHING for line in shown)]
    return Table(title, tuple(kept), tuple(tuple(line[column] for column in kept) for line in shown))


def _short(cell: str) -> str:
    if cell.startswith((UNDEFINED_RATIO, NOT_MEANINGFUL)):
        return cell.partition(":")[0]
    return NOTHING if cell.startswith(NO_INTERVAL) else cell


def terminal_table(table: Table, width_characters: int) -> RichTable:
    """The first column wraps where it is too long, heads wrap at spaces, and numbers are never truncated."""
    grid = RichTable(
        title=table.title,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    first, *others = (
        max(len(text) for text in (*head.split(), *(line[column] for line in table.lines)))
        for column, head in enumerate(table.heads)
    )
    room = width_characters - sum(width + 2 for width in others) - 2
    widths = [max(min(first, room), MIN_TITLE), *others]
    for column, (head, width) in enumerate(zip(table.heads, widths, strict=True)):
        justify: Literal["left", "right"] = "left" if column == 0 else "right"
        grid.add_column(head, justify=justify, width=width, overflow="fold")
    for line in table.lines:
        grid.add_row(*line, style="dim" if line[0].startswith((CLEAN, " ")) else None)
    return grid
