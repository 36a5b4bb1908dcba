"""Figures that draw untrusted text literally: it is never parsed as a formula."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import matplotlib.figure
from matplotlib.axis import Axis
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter, LogFormatter

MOST_CHARACTERS = 200
"""The longest text in a figure: longer ones would leave no room for the drawing."""


class Figure(matplotlib.figure.Figure):
    """A matplotlib figure in which only the numbers of logarithmic axes are parsed as `$formulas$`."""

    def draw(self, renderer: Any) -> None:
        """Draw the figure; texts from bags are made printable first."""
        self._make_printable()
        super().draw(renderer)

    def lay_out(self) -> None:
        """Lay the figure out once: it is drawn as it stands now from here on, in every format."""
        if engine := self.get_layout_engine():
            self._make_printable()
            engine.execute(self)
            self.set_layout_engine(None)

    def _make_printable(self) -> None:
        for axes in self.axes:
            _make_labels_printable(axes.xaxis)
            _make_labels_printable(axes.yaxis)
        numbers = {id(text) for text in _logarithmic_labels(self)}
        for text in self.findobj(Text):
            assert isinstance(text, Text)
            if id(text) not in numbers:
                text.set_parse_math(False)
                text.set_text(printable_text(text.get_text()))


def printable_text(text: str) -> str:
    """The text with unprintable characters replaced and a very long one truncated; line breaks are kept."""
    if text.isprintable() and len(text) <= MOST_CHARACTERS:
        return text
    if len(text) > MOST_CHARACTERS:
        text = f"{text[: MOST_CHARACTERS - 1]}…"
    return "".join(char if char.isprintable() or char == "\n" else "\ufffd" for char in text)


class _PrintableLabels:
    """A tick formatter function whose labels are made printable."""

    def __init__(self, label: Callable[..., str]) -> None:
        self.label = label

    def __call__(self, *position: Any) -> str:
        return printable_text(self.label(*position))


def _make_labels_printable(axis: Axis) -> None:
    """Make tick labels printable in the formatter, since an axis sets their text anew at each drawing."""
    formatter = axis.get_major_formatter()
    if isinstance(formatter, FuncFormatter) and not isinstance(formatter.func, _PrintableLabels):
        formatter.func = _PrintableLabels(formatter.func)
    elif isinstance(formatter, FixedFormatter):
        formatter.seq = [printable_text(name) for name in formatter.seq]


def _logarithmic_labels(figure: Figure) -> list[Text]:
    """The tick labels that matplotlib itself writes at logarithmic axes, as powers."""
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
