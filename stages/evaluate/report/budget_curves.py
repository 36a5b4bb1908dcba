"""Curves of an attack that was made with several budgets: mAP ratio over budget and over Chamfer distance."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence

from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.results.metrics import CloudMetrics, Interval
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_names, baseline_title
from advpipe.stages.evaluate.report.style import BASELINE, INK, PREDICTION, SOFT, plain_axes

Point = tuple[float, float, Interval]
"""Where on the axis, the mAP ratio, and its interval."""

Where = Callable[[ResultRow, CloudMetrics], float]

FORMATS = dict(zip(baseline_names(), ("D--", "o-", "s-", "^-"), strict=True))


def budget_groups(rows: Sequence[ResultRow]) -> list[list[ResultRow]]:
    """Rows of one attack, recipe and detector, alike but for the budget, of which there are two or more."""
    groups: dict[str, list[ResultRow]] = {}
    for row in rows:
        made_by = row.attack
        if isinstance(made_by.value, int | float):
            rest = {name: each for name, each in made_by.parameters.items() if name != made_by.parameter}
            about = [row.detector, made_by.attacked_against, made_by.attack, made_by.recipe]
            key = json.dumps([*about, made_by.parameter, row.counts.frames, rest], sort_keys=True)
            groups.setdefault(key, []).append(row)
    ordered = [sorted(group, key=lambda row: float(row.attack.value)) for group in groups.values()]
    return [group for group in ordered if len({row.attack.value for row in group}) > 1]


def draw_budget_curves(rows: Sequence[ResultRow]) -> Figure:
    """Two panels: over the budget, and over the Chamfer distance; the attack in red, baselines in grey."""
    figure = Figure(figsize=(11, 4.4), dpi=110, facecolor="white", layout="constrained")
    panels: tuple[tuple[str, Where, str], ...] = (
        (str(rows[0].attack.parameter), lambda row, _: float(row.attack.value), "linear"),
        ("Chamfer distance in m²", lambda _, metrics: metrics.chamfer_distance_m2, "log"),
    )
    names = [name for name in baseline_names() if all(name in row.baselines for row in rows)]
    for place, (label, where, scale) in enumerate(panels):
        axes = figure.add_subplot(1, 2, place + 1)
        plain_axes(axes)
        axes.axhline(100, color="#c9d1da", linewidth=1, zorder=1)
        for name in names:
            _draw_line(axes, _points(rows, where, name), FORMATS[name], BASELINE, baseline_title(name))
        _draw_line(axes, _points(rows, where), "o-", PREDICTION, "attack")
        if all(row.attacked and where(row, row.attacked) for row in rows):
            axes.set_xscale(scale)
        axes.set_ylim(bottom=0)
        axes.set_xlabel(label, color=SOFT)
        if place == 0:
            axes.set_ylabel("mAP ratio in %", color=SOFT)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles[::-1], labels[::-1], loc="outside lower center", ncols=4, frameon=False, fontsize=9,
        labelcolor=INK,
    )  # fmt: skip
    return figure


def _draw_line(axes: Axes, points: Sequence[Point], style: str, colour: str, label: str) -> None:
    """The points with their intervals; a baseline lies over its own Chamfer distance."""
    if not points:
        return
    x, y = [point[0] for point in points], [point[1] for point in points]
    axes.plot(x, y, style, color=colour, markersize=5, linewidth=1.5, label=label, zorder=3)
    for place, _, bounds in points:
        if bounds is not None:
            axes.plot([place, place], bounds, color=colour, linewidth=2, alpha=0.35, zorder=2)


def _points(rows: Sequence[ResultRow], where: Where, baseline: str = "") -> list[Point]:
    """Those with a mAP ratio, of the attack or of a baseline, in order."""
    shown = [(row, metrics) for row in rows if (metrics := row.metrics_of(baseline))]
    return sorted(
        (where(row, each), each.map_ratio_percent, each.map_ratio_ci95)
        for row, each in shown
        if not math.isnan(each.map_ratio_percent)
    )
