"""Precision over recall by class: on the clean clouds by every criterion, and attacked beside clean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.style import BASELINE, INK, PREDICTION, SOFT, plain_axes

Float64 = npt.NDArray[np.float64]


class Line(NamedTuple):
    """One curve of each class: of which clouds, by which criterion, and how it looks."""

    cloud: str
    criterion: str
    label: str
    colour: str
    dashes: str


CLEAN_LINES = tuple(
    Line("clean", criterion, CRITERIA[criterion].title, colour, dashes)
    for criterion, colour, dashes in (
        ("strict", INK, "-"),
        ("loose", INK, ":"),
        ("bev", "#0b8a8a", "-"),
        ("bev_loose", "#0b8a8a", ":"),
    )
)
ATTACK_LINES = (
    Line("clean", "strict", "clean", INK, "-"),
    Line("random_best", "strict", "random-best", BASELINE, "-"),
    Line("adv", "strict", "attacked", PREDICTION, "-"),
)


def draw_precision_curves(summary: Summary, lines: Sequence[Line]) -> Figure:
    """One panel a class, with the average precision R40 of each line beside its name."""
    precision = {
        (cloud, each.criterion, each.name): each.ap_r40
        for cloud, precisions in summary.precisions.items()
        for each in precisions
        if not each.by
    }
    boxes = {each.name: each.boxes for each in summary.precisions["clean"] if not each.by}
    names = [name for name in CLASSES if boxes.get(name)]
    figure = Figure(figsize=(3.75 * len(names), 3.7), dpi=110, facecolor="white", layout="constrained")
    for column, name in enumerate(names):
        axes = figure.add_subplot(1, len(names), column + 1)
        plain_axes(axes)
        axes.set_title(f"{name}   {boxes[name]:,} boxes", loc="left", fontsize=11, color=INK)
        for line in lines:
            key = (line.cloud, line.criterion, name)
            if key in summary.curves:
                _draw_curve(axes, line, summary.curves, key, precision[key])
        axes.set_xlim(0, 1.005)
        axes.set_ylim(0, 1.015)
        axes.set_xlabel("recall", color=SOFT)
        if column == 0:
            axes.set_ylabel("precision", color=SOFT)
        axes.legend(
            loc="best", fontsize=8, labelcolor=INK, handlelength=1.6, framealpha=0.85, edgecolor="none"
        )
    return figure


def _draw_curve(
    axes: Axes,
    line: Line,
    curves: Mapping[tuple[str, str, str], tuple[Float64, Float64]],
    key: tuple[str, str, str],
    precision: float,
) -> None:
    recall, exact = curves[key]
    start = exact[:1]  # the curve begins at the left edge
    axes.plot(
        np.concatenate([np.zeros(len(start)), recall]), np.concatenate([start, exact]), line.dashes,
        color=line.colour, linewidth=1.5, label=f"{line.label}  {precision:.3f}",
    )  # fmt: skip
