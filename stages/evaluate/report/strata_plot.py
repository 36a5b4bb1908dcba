"""Average precision by range, number of points and occlusion, class by class."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.detection.condition import Precision
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.report.style import CLASS_COLOURS, INK, SOFT, plain_axes

TITLES = {"range": "by range", "points": "by LiDAR points", "occlusion": "by share hidden"}


def draw_strata(precisions: Sequence[Precision], criterion: str = "strict") -> Figure:
    """One panel a measure; a dot a class and stratum, with its interval, and how many boxes are behind it."""
    chosen = [each for each in precisions if each.by and each.criterion == criterion]
    measures = [by for by in TITLES if any(each.by == by for each in chosen)]
    names = [name for name in CLASS_COLOURS if any(each.name == name and each.boxes for each in chosen)]
    figure = Figure(figsize=(5 * len(measures), 3.9), dpi=110, facecolor="white", layout="constrained")
    for column, by in enumerate(measures):
        axes = figure.add_subplot(1, len(measures), column + 1)
        plain_axes(axes)
        axes.set_title(TITLES[by], loc="left", fontsize=11, color=INK)
        strata = [stratum.name for stratum in STRATA if stratum.by == by]
        for number, name in enumerate(names):
            shift = 0.62 * ((number + 0.5) / len(names) - 0.5)
            for place, stratum in enumerate(strata):
                for each in chosen:
                    if (each.by, each.stratum, each.name) == (by, stratum, name) and each.boxes:
                        _draw_dot(axes, place + shift, each)
        axes.set_xticks(range(len(strata)), strata)
        axes.set_xlim(-0.5, len(strata) - 0.5)
        axes.set_ylim(-0.06, 1.08)
        axes.set_yticks([0, 0.2, 0.4, 0.6, 0.8, 1.0])
        if column == 0:
            axes.set_ylabel("AP, strict 3D, R40", color=SOFT)
    for name in names:
        figure.axes[0].plot([], [], "o", color=CLASS_COLOURS[name], label=name)
    figure.legend(loc="outside lower center", ncols=len(names), frameon=False, fontsize=9, labelcolor=INK)
    return figure


def _draw_dot(axes: Axes, x: float, each: Precision) -> None:
    colour = CLASS_COLOURS[each.name]
    top = each.ap_r40
    if each.ap_r40_ci95 is not None:
        top = max(top, each.ap_r40_ci95[1])
        axes.plot([x, x], each.ap_r40_ci95, color=colour, linewidth=2, alpha=0.45, zorder=2)
    axes.plot([x], [each.ap_r40], "o", color=colour, markersize=6, zorder=3)
    axes.annotate(
        f"{each.boxes:,}", (x, top), xytext=(0, 6 if each.ap_r40 == top else 3),
        textcoords="offset points", ha="center", fontsize=7, color=colour,
    )  # fmt: skip
