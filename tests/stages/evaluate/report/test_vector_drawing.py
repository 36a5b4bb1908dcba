"""Drawings read from SVG, against matplotlib's own picture of the same figure."""

import io

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.pictures import to_pdf, to_png, to_svg
from advpipe.stages.evaluate.report.vector_drawing import figure_of_svg

DPI = 100


def pixels(figure: Figure) -> np.ndarray:
    """(H, W, 3) in [0, 1]."""
    FigureCanvasAgg(figure)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI)
    return np.asarray(imread(io.BytesIO(stream.getvalue())))[..., :3]


def drawn() -> Figure:
    """Something of everything that figures of reports have."""
    figure = Figure(figsize=(4, 3), facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1, 2], [0, 4, 1], "o--", color="#d61f26", label="dashed, with marks")
    axes.plot([0, 5], [3, 3], ":", linewidth=3, alpha=0.4)  # leaves the axes
    axes.fill_between([0, 2], [0, 0], [1, 2], color="#1d5fd1", alpha=0.3)
    axes.scatter([0.5, 1.5], [2, 2], s=400, color="#0a7f7f", rasterized=True)
    axes.set_xlim(0, 2)
    axes.set_xlabel("time s")
    axes.set_ylabel("upright")
    axes.legend()
    figure.lay_out()
    return figure


def test_looks_as_matplotlib_draws_it() -> None:
    svg = to_svg(drawn())
    expected, found = pixels(drawn()), pixels(figure_of_svg(svg))
    assert found.shape == expected.shape
    assert (np.abs(found - expected).max(axis=2) > 0.35).mean() < 0.01  # texts are not hinted
    assert (expected < 0.9).any(axis=2).mean() > 0.1
    assert np.abs(found - expected).mean() < 0.01


def test_the_same_bytes_each_time() -> None:
    svg = to_svg(drawn())
    one, two = (to_pdf(figure_of_svg(svg)) for _ in range(2))
    assert one.startswith(b"%PDF")
    assert one == two


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"</svg>", b""),
        (b"viewBox", b"box"),
        (b'd="M', b'd="A'),
        (b"data:image/png;base64", b"file:///etc/hostname"),
        (b"iVBORw0KGgo", b"AAAAAAAAAAA"),
        (b"scale(", b"skewX("),
        (b"<!DOCTYPE svg", b'<!DOCTYPE svg [<!ENTITY a "b">]'),
        (b'xlink:href="#', b'xlink:href="#no'),
    ],
)
def test_other_files_are_refused(old: bytes, new: bytes) -> None:
    svg = to_svg(drawn())
    assert old in svg
    with pytest.raises(AdvpipeError, match=r"^not a drawing by matplotlib: "):
        figure_of_svg(svg.replace(old, new))


def test_a_figure_is_laid_out_once() -> None:
    """The PNG before and after is the same: what was laid out stays."""
    first, again = drawn(), drawn()
    assert first.get_layout_engine() is None
    to_svg(first)
    assert to_png(first) == to_png(again)
