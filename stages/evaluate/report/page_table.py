"""Tables as the page shows them: without empty columns, texts to the left, heads that explain themselves."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from advpipe.stages.evaluate.report.numbers import NO_INTERVAL, NOTHING
from advpipe.stages.evaluate.report.section import Table

TERMS: Mapping[str, str] = {
    "map": "map", "ratio": "map_ratio", "map ratio": "map_ratio", "map ratio, strict": "map_ratio",
    "map ratio, loose": "iou", "strict": "iou", "loose": "iou", "95": "interval", "car ap": "ap", "r11": "ap",
    "cd": "chamfer", "lost": "lost", "displaced": "displaced", "success": "attack_success",
    "new fp": "attack_success", "significant": "significant_vs_random",
    "baseline's map ratio": "baseline", "δ to baseline, points": "baseline", "defence": "defence",
    "kept": "defence", "objects, recounted": "recounted", "random baseline": "baseline",
    "plain random baseline": "baseline", "f1": "F1, MCC", "mcc": "F1, MCC", "bird's-eye": "iou",
}  # fmt: skip
"""The definition that a head of a table means, without its unit."""

_UNIT = re.compile(r" (%|m²|m|s|dB|dBm|Hz|ms|points)$")
_NUMBER = re.compile(r"^[−+~-]?\d")


@dataclass(frozen=True)
class Head:
    """The head of a column. term: the name of its definition, which `meaning` is; "" for none."""

    text: str
    is_text: bool
    term: str = ""
    meaning: str = ""


@dataclass(frozen=True)
class ShownTable:
    """A table of the page. lines: a class of the line's looks, and its cells."""

    title: str
    heads: tuple[Head, ...]
    lines: tuple[tuple[str, tuple[str, ...]], ...]
    note: str


def shown_table(table: Table, formulas: Mapping[str, str]) -> ShownTable:
    """The table without columns that hold nothing; formulas: the definitions of its report, by name.

    A column in which every line says that there is no interval holds nothing: the first screen says why.
    """
    columns = [[line[place] for line in table.lines] for place in range(len(table.heads))]
    kept = [place for place, cells in enumerate(columns) if place == 0 or not all(map(_says_nothing, cells))]
    return ShownTable(
        table.title,
        tuple(_head(table.heads[place], columns[place], place, formulas) for place in kept),
        tuple((_looks(line), tuple(line[place].strip() for place in kept)) for line in table.lines),
        table.note,
    )


def _head(text: str, cells: Sequence[str], place: int, formulas: Mapping[str, str]) -> Head:
    term = _term(text, formulas)
    said = [cell.strip() for cell in cells if not _says_nothing(cell)]
    is_text = place == 0 or 2 * sum(1 for cell in said if _NUMBER.match(cell)) < len(said)
    return Head(_UNIT.sub("\u00a0\\1", text), is_text, term, formulas.get(term, ""))


def _term(head: str, formulas: Mapping[str, str]) -> str:
    """The definition that is named like the head or has it among its names; "" without one."""
    term = _UNIT.sub("", head.lower().removesuffix(", r40"))
    for name in formulas:
        if term in [each.strip() for each in name.lower().split(",")]:
            return name
    for candidate in (TERMS.get(term), TERMS.get(term.partition(":")[0].partition(",")[0])):
        if candidate in formulas:
            return str(candidate)
    return ""


def _says_nothing(cell: str) -> bool:
    return cell.strip() in ("", NOTHING) or cell.startswith(NO_INTERVAL)


def _looks(line: Sequence[str]) -> str:
    """`clean`, `random` and `attack` are lines of the table of all results; `sum` ends a table."""
    if line[0] in ("mAP", "every class"):
        return "sum"
    if line[0].startswith("  "):
        return "random"
    return "clean" if line[0].startswith("clean") else "attack"
