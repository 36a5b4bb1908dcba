"""Curves: mAP ratio over the paper's budgets, over the Chamfer distance, and over the number of steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from math import isnan

from matplotlib.axes import Axes

from advpipe.pipeline.campaigns.sweep.budgets import AXES, BUDGETS
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.tables import RANDOM
from advpipe.pipeline.campaigns.sweep.variants import by_steps, steps_factor
from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.style import BASELINE, INK, LINE, PREDICTION, SOFT, TRUTH, plain_axes

MARKS = ("o", "s", "^", "D", "v")
PAPER = "the paper"


@dataclass(frozen=True)
class Point:
    """x: the budget as the paper prints it, and the Chamfer distance in m². y: mAP ratio in percent."""

    x: tuple[float, float]
    y: float
    bounds: tuple[float, float] | None = None


def draw_sweep_curves(cells: Sequence[Cell], attack: str) -> Figure:
    """Two panels of one attack: the paper's figures in blue, ours in red, the baseline to beat in grey."""
    figure = Figure(figsize=(11, 4.4), dpi=110, facecolor="white", layout="constrained")
    lines = curve_points(cells, attack)
    for place, label in enumerate((AXES[attack].title, "Chamfer distance in m²")):
        axes = figure.add_subplot(1, 2, place + 1)
        plain_axes(axes)
        axes.axhline(100, color=LINE, linewidth=1, zorder=1)
        for (title, colour, style), points in lines.items():
            _draw_line(axes, [point for point in points if point.x[place] > 0], place, title, colour, style)
        axes.set_xscale("log")
        axes.set_ylim(0, max(105.0, axes.get_ylim()[1]))
        axes.set_xlabel(label, color=SOFT)
        if place == 0:
            axes.set_ylabel("mAP ratio in %", color=SOFT)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9, labelcolor=INK
    )
    return figure


def curve_points(cells: Sequence[Cell], attack: str) -> dict[tuple[str, str, str], list[Point]]:
    """The points of each line, in the order of budgets; by title, colour and style of the line."""
    budgets = {budget.name: budget for budget in BUDGETS if budget.attack == attack}
    lines: dict[tuple[str, str, str], list[Point]] = {
        (PAPER, TRUTH, "x--"): [
            Point((each.printed, each.paper_chamfer_distance_m2), each.paper_map_ratio_percent)
            for each in budgets.values()
            if not isnan(each.paper_map_ratio_percent)
        ]
    }
    for number, recipe in enumerate(_plain_recipes(cells)):
        mark = MARKS[number % len(MARKS)]
        mine = {cell.budget: cell for cell in cells if cell.recipe == recipe}
        for title, colour, style, is_random in (
            (f"ours, recipe {recipe}", PREDICTION, f"{mark}-", False),
            (f"{RANDOM} beside {recipe}", BASELINE, f"{mark}:", True),
        ):
            points = [
                point
                for name, budget in budgets.items()
                if name in mine and (point := _point(mine[name], budget.printed, is_random))
            ]
            if points:
                lines[title, colour, style] = points
    return lines


def _plain_recipes(cells: Sequence[Cell]) -> list[str]:
    return sorted({cell.recipe for cell in cells if steps_factor(cell.recipe) == 1})


def draw_convergence(cells: Sequence[Cell]) -> Figure | None:
    """mAP ratio over the number of steps, of the cells that were run with others, too; None without."""
    families = by_steps(cells)
    if not families:
        return None
    figure = Figure(figsize=(7.5, 4.4), dpi=110, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    plain_axes(axes)
    for mark, (name, family) in zip(cycle(MARKS), families.items(), strict=False):
        points = [point for cell in family if (point := _point(cell, steps_factor(cell.recipe), False))]
        _draw_line(axes, points, 0, name, PREDICTION, f"{mark}-")
    axes.set_xscale("log", base=2)
    factors = sorted({steps_factor(cell.recipe) for family in families.values() for cell in family})
    axes.set_xticks(factors, [f"x {factor:g}" for factor in factors])
    axes.set_ylim(0, None)
    axes.set_xlabel("steps, of those of the recipe", color=SOFT)
    axes.set_ylabel("mAP ratio in %", color=SOFT)
    axes.legend(frameon=False, fontsize=9, labelcolor=INK)
    return figure


def _point(cell: Cell, printed: float, is_random: bool) -> Point | None:
    metrics = cell.strongest_random if is_random else cell.attacked
    if metrics is None or isnan(metrics.chamfer_distance_m2) or isnan(metrics.map_ratio_percent):
        return None
    return Point((printed, metrics.chamfer_distance_m2), metrics.map_ratio_percent, metrics.map_ratio_ci95)


def _draw_line(axes: Axes, points: Sequence[Point], place: int, title: str, colour: str, style: str) -> None:
    ordered = sorted(points, key=lambda point: point.x[place])
    x, y = [point.x[place] for point in ordered], [point.y for point in ordered]
    axes.plot(x, y, style, color=colour, markersize=5, linewidth=1.5, label=title, zorder=3)
    for point in ordered:
        if point.bounds is not None:
            axes.plot([point.x[place]] * 2, point.bounds, color=colour, linewidth=2, alpha=0.35, zorder=2)
