"""Curves of an attack that was made with several budgets: mAP ratio over budget and over Chamfer distance."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.detection.baseline import BASELINES, BEST, baseline_title, baseline_words
from advpipe.stages.evaluate.detection.figures import Row
from advpipe.stages.evaluate.report.style import BASELINE, INK, PREDICTION, SOFT, plain_axes

FORMATS = dict(zip(BASELINES, ("o", "s", "^"), strict=True))


def budget_groups(rows: Sequence[Row]) -> list[list[Row]]:
    """Rows of one attack, recipe and detector, alike but for the budget, of which there are two or more."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        value, parameters = row["value"], row["parameters"]
        if isinstance(value, int | float) and isinstance(parameters, dict):
            rest = {name: each for name, each in parameters.items() if name != row["parameter"]}
            about = [row[key] for key in ("detector", "attacked_against", "attack", "recipe", "parameter")]
            groups.setdefault(json.dumps([*about, row["frames"], rest], sort_keys=True), []).append(row)
    ordered = [sorted(group, key=_value) for group in groups.values()]
    return [group for group in ordered if len({row["value"] for row in group}) > 1]


def draw_budget_curves(rows: Sequence[Row]) -> Figure:
    """Two panels: over the budget, and over the Chamfer distance; the attack in red, baselines in grey."""
    figure = Figure(figsize=(11, 4.4), dpi=110, facecolor="white", layout="constrained")
    panels = (
        (str(rows[0]["parameter"]), "value", "linear"),
        ("Chamfer distance in m²", "chamfer_distance_m2", "log"),
    )
    words = [word for word in baseline_words() if all(_has(row, word) for row in rows)]
    for place, (label, key, scale) in enumerate(panels):
        axes = figure.add_subplot(1, 2, place + 1)
        plain_axes(axes)
        axes.axhline(100, color="#c9d1da", linewidth=1, zorder=1)
        for word in words:
            line = "--" if word.endswith(BEST) else "-"
            style = f"{FORMATS[word.removesuffix(BEST)]}{line}"
            _draw_line(axes, rows, f"{word}_", key, style, BASELINE, baseline_title(word))
        _draw_line(axes, rows, "", key, "o-", PREDICTION, "attack")
        if all(isinstance(row[key], float | int) and row[key] for row in rows):
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


def _draw_line(
    axes: Axes, rows: Sequence[Row], prefix: str, key: str, style: str, colour: str, label: str
) -> None:
    """The points with their intervals; a baseline lies over its own Chamfer distance."""
    points = sorted(_points(rows, prefix, key))
    if not points:
        return
    x, y = [point[0] for point in points], [point[1] for point in points]
    axes.plot(x, y, style, color=colour, markersize=5, linewidth=1.5, label=label, zorder=3)
    for place, _, bounds in points:
        if bounds is not None:
            axes.plot([place, place], bounds, color=colour, linewidth=2, alpha=0.35, zorder=2)


def _points(
    rows: Sequence[Row], prefix: str, key: str
) -> Iterator[tuple[float, float, tuple[float, float] | None]]:
    for row in rows:
        x, y = row[key if key == "value" else prefix + key], row[f"{prefix}map_ratio_percent"]
        bounds = row[f"{prefix}map_ratio_ci95"]
        if isinstance(x, float | int) and isinstance(y, float) and y == y:
            yield float(x), y, bounds if isinstance(bounds, tuple) else None


def _has(row: Row, word: str) -> bool:
    words = row["baselines"]
    return isinstance(words, list) and word in words


def _value(row: Row) -> float:
    value = row["value"]
    return float(value) if isinstance(value, int | float) else 0.0
