"""The mAP ratio of each attack beside that of its random baseline, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.results.metrics import CloudMetrics
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.report.numbers import short_name, shown_interval
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.style import BASELINE, INK, PREDICTION
from advpipe.stages.evaluate.report.wording import TO_BEAT


def draw_ratios(rows: Sequence[ResultRow]) -> Figure:
    """A line for each attack: the attack in red, the baseline to beat in grey."""
    seen = {row.detector for row in rows}
    titles = [
        attack_title(row.attack) + (f", seen by {short_name(row.detector)}" if len(seen) > 1 else "")
        for row in rows
    ]
    figure = Figure(figsize=(11, 1.3 + 0.62 * len(rows)), dpi=110, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    axes.axvline(100, color="#c9d1da", linewidth=1, zorder=1)
    for line, row in enumerate(rows):
        if strongest := row.strongest_baseline:
            _draw_ratio(axes, row, row.metrics_of(strongest), line + 0.17, BASELINE)
        _draw_ratio(axes, row, row.attacked, line - 0.17, PREDICTION)
    axes.set_yticks(range(len(rows)), titles, color=INK)
    axes.set_ylim(len(rows) - 0.45, -0.55)
    axes.margins(x=0.1)
    axes.set_xlim(left=0)
    axes.set_xlabel(
        "mAP ratio in % of the clean mAP, with its 95 % interval: lower is a stronger attack", color=INK
    )
    axes.grid(axis="x", color="#eceff3", zorder=0)
    axes.tick_params(length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    for colour, label in ((PREDICTION, "attack"), (BASELINE, TO_BEAT)):
        axes.plot([], [], "o", color=colour, label=label)
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=2, fontsize=9, labelcolor=INK
    )
    return figure


def _draw_ratio(axes: Axes, row: ResultRow, metrics: CloudMetrics | None, height: float, colour: str) -> None:
    """A dot with its interval and, to the right of both, its value."""
    if metrics is None or math.isnan(metrics.map_ratio_percent):
        return
    ratio, bounds = metrics.map_ratio_percent, shown_interval(metrics.map_ratio_ci95, row.counts)
    if bounds is not None:
        axes.plot(bounds, [height, height], color=colour, linewidth=2, solid_capstyle="round", zorder=2)
    axes.plot([ratio], [height], "o", color=colour, markersize=7, zorder=3, clip_on=False)
    axes.annotate(
        f"{ratio:.1f} %", (max([ratio, *(bounds or ())]), height), xytext=(7, 0), textcoords="offset points",
        ha="left", va="center", fontsize=8, color=colour, annotation_clip=False,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )  # fmt: skip
