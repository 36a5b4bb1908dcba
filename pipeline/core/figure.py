"""Figures whose texts are drawn as they are written, whoever wrote them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib.figure
from matplotlib.axis import Axis
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter, LogFormatter

MOST_CHARACTERS = 200
"""Of one text: longer ones would leave no room for what is drawn."""


class Figure(matplotlib.figure.Figure):
    """matplotlib's, in which only the numbers of logarithmic axes are formulas between dollar signs."""

    def draw(self, renderer: Any) -> None:
        for axes in self.axes:
            _show_names(axes.xaxis)
            _show_names(axes.yaxis)
        numbers = {id(text) for text in _numbers(self)}
        for text in self.findobj(Text):
            assert isinstance(text, Text)
            if id(text) not in numbers:
                text.set_parse_math(False)
                text.set_text(printable_text(text.get_text()))
        super().draw(renderer)


def printable_text(text: str) -> str:
    """A text that fonts have signs for, on as many lines as it has, cut where it is very long."""
    if text.isprintable() and len(text) <= MOST_CHARACTERS:
        return text
    if len(text) > MOST_CHARACTERS:
        text = f"{text[: MOST_CHARACTERS - 1]}…"
    return "".join(sign if sign.isprintable() or sign == "\n" else "\ufffd" for sign in text)


class _Shown:
    """A function that names ticks, for names of others."""

    def __init__(self, named: Callable[..., str]) -> None:
        self.named = named

    def __call__(self, *where: Any) -> str:
        return printable_text(self.named(*where))


def _show_names(axis: Axis) -> None:
    """Of ticks that were given names, which an axis writes anew each time."""
    formatter = axis.get_major_formatter()
    if isinstance(formatter, FuncFormatter) and not isinstance(formatter.func, _Shown):
        formatter.func = _Shown(formatter.func)
    elif isinstance(formatter, FixedFormatter):
        formatter.seq = [printable_text(name) for name in formatter.seq]


def _numbers(figure: Figure) -> list[Text]:
    """What matplotlib itself writes at logarithmic axes, as powers."""
    return [
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for formatter, ticks in (
            (axis.get_major_formatter(), axis.get_major_ticks()),
            (axis.get_minor_formatter(), axis.get_minor_ticks()),
        )
        if isinstance(formatter, LogFormatter)
        for tick in ticks
        for label in (tick.label1, tick.label2)
    ]
