"""A name is drawn as it is written, in every figure that advpipe draws."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.mathtext import MathTextParser

from advpipe.pipeline.core.figure import MOST_CHARACTERS, Figure

SOURCES = Path(__file__).parents[3]
NAMES = [
    r"$\foo$",
    "a$_{$b",
    "100 % of $x$",
    "$" * 5,
    r"\$5\$",
    "two\nlines",
    "\x1b[31mred",
    "<script>alert(1)</script>",
    "--> ]]>",
    "x" * 5000,
]


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:20])
@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_names_are_drawn_literally_everywhere(name: str, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MathTextParser, "parse", _refuse_formulas)
    figure = drawing(name)
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no room for the axes beside it
        figure.savefig(stream, format=form)
    if form == "svg":
        tags = {
            element.tag.rpartition("}")[2] for element in ElementTree.fromstring(stream.getvalue()).iter()
        }
        assert not tags & {"script", "image", "a", "foreignObject"}


def test_a_figure_without_formulas_is_unchanged() -> None:
    from matplotlib.figure import Figure as Plain

    assert (pixels(drawing("town 5 %")) == pixels(drawing("town 5 %", Plain))).all()
    ours, plain = drawing("town"), drawing("town", Plain)
    for figure in (ours, plain):
        figure.axes[0].set_yscale("log")  # whose numbers are formulas
    assert (pixels(ours) == pixels(plain)).all()


def test_dollar_signs_are_drawn() -> None:
    assert (pixels(drawing("a$b$c")) != pixels(drawing("abc"))).any()
    assert (pixels(drawing("a" * 300)) == pixels(drawing("a" * (MOST_CHARACTERS - 1) + "…"))).all()


def test_every_figure_of_advpipe_uses_this_class() -> None:
    for path in (*SOURCES.glob("pipeline/**/*.py"), *SOURCES.glob("stages/**/*.py")):
        text = path.read_text(encoding="utf-8")
        if path.name != "figure.py":
            assert not re.search(r"from matplotlib\.figure import Figure|matplotlib\.pyplot", text), path


def drawing(name: str, kind: type = Figure) -> Figure:
    figure = kind(figsize=(4, 3))
    axes = figure.subplots()
    axes.plot([1, 1000], [1, 1000], label=name)
    axes.set(title=name, xlabel=name)
    axes.set_yticks([1, 10], labels=[name, "b"])
    axes.annotate(name, (1, 1))
    figure.text(0.1, 0.1, name)
    figure.suptitle(name)
    figure.legend()
    return figure  # type: ignore[no-any-return]


def pixels(figure: Figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).copy()


def _refuse_formulas(self: object, text: str, *others: object, **more: object) -> None:
    raise AssertionError(f"a formula: {text}")
