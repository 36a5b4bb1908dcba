"""Tables on a terminal of 80 columns: nothing that is needed is truncated."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from advpipe.stages.evaluate.detection.baseline import baseline_names, baseline_title
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.terminal import COLUMNS, terminal_table

NUMBERS = ("0.812", "100.00", "40.1…52.3", "0.812", "0.00101", "~100.00 %", "12,345")


def printed(table: Table, width: int = 80) -> list[str]:
    stream = io.StringIO()
    Console(file=stream, width=width, markup=False, emoji=False).print(terminal_table(table, width))
    return stream.getvalue().splitlines()


def first_column(lines: list[str], numbers: tuple[str, ...]) -> str:
    """What stands below the heads besides the numbers."""
    (rule,) = (place for place, line in enumerate(lines) if "───" in line)
    words = " ".join(lines[rule + 1 :]).split()
    return " ".join(word for word in words if word not in {each for n in numbers for each in n.split()})


@pytest.mark.parametrize("name", baseline_names())
def test_names_of_baselines_are_whole(name: str) -> None:
    title = baseline_title(name)
    lines = printed(Table("", COLUMNS, ((f"  {title}", *NUMBERS),)))
    assert max(map(len, lines)) <= 80
    assert all(any(number in line for line in lines) for number in NUMBERS)
    assert first_column(lines, NUMBERS).split() == title.split()


def test_long_heads_wrap_and_long_names_fold() -> None:
    attack = "cam-mix / cam-position-random-offset-with-a-name-that-goes-on"
    heads = ("V2X attack", "messages received", "false messages", "attackers detected %", "latency s")
    numbers = ("1,234", "12", "100", "0.20")
    lines = printed(Table("a title", heads, ((attack, *numbers),)))
    assert max(map(len, lines)) <= 80
    assert "".join(first_column(lines, numbers).split()) == "".join(attack.split())
    assert all(word in " ".join(lines) for head in heads for word in head.split())
