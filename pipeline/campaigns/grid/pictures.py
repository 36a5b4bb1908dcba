"""Pictures of a grid: a heat map for each detector, and a curve over the levels of each factor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle, product
from pathlib import Path

import numpy as np

from advpipe.pipeline.campaigns.grid.models import UNDEFENDED, GridFile
from advpipe.pipeline.campaigns.grid.statistics import GridGroup
from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import OVERVIEW, ReportPicture
from advpipe.stages.evaluate.report.style import INK, LINE, SOFT, plain_axes

COLOURS = ("#d61f26", "#1f5fd6", "#0b8a8a", "#c26a00", "#7a3ff2", "#5c6876")
MARKS = ("o", "s", "^", "D", "v")
MOST_PICTURES = 40
MOST_LINES = 12
"""In one picture of curves; the table has the others."""


def grid_pictures(grid: GridFile, groups: Sequence[GridGroup]) -> list[ReportPicture]:
    """A heat map for each detector, then for each factor with several levels its curves."""
    found = []
    for number, detector in enumerate(grid.detectors):
        mine = [group for group in groups if group.key[2] == detector]
        name = Path(detector).name
        caption = f"mAP ratio in percent over {len(grid.seeds)} drives each, seen by {name}"
        figure = draw_heat_map(grid, mine)
        found.append(picture_of(OVERVIEW, "", f"heat{number + 1}.png", caption, figure))
        for place, factor in enumerate(grid.factors):
            if len(grid.factors[factor]) < 2:
                continue
            caption = f"mAP ratio over {factor}, with 95 % intervals over drives, seen by {name}"
            figure = draw_level_curves(grid, mine, factor)
            file_name = f"curve{number + 1}-{place + 1}.png"
            found.append(picture_of(OVERVIEW, "", file_name, caption, figure))
    return found[:MOST_PICTURES]


def draw_heat_map(grid: GridFile, groups: Sequence[GridGroup]) -> Figure:
    """mAP ratios of one detector: a line for each attack and defence, a column for each combination of
    levels."""
    attacks = list(dict.fromkeys(group.key[1] for group in groups))
    lines = [f"{attack}{_under(defence)}" for attack, defence in product(attacks, grid.defences)]
    labels = list(product(*([label for label, _ in grid.levels(factor)] for factor in grid.factors)))
    columns = ["\n".join(map(str, each)) or "all drives" for each in labels]
    by_key = {(group.key[0], group.key[1], group.key[3]): group.ratio() for group in groups}
    values = np.array(
        [
            [by_key[levels, attack, defence].percent for levels in labels]
            for attack, defence in product(attacks, grid.defences)
        ]
    )
    figure = Figure(
        figsize=(min(3 + 0.9 * len(columns), 40), min(1.6 + 0.45 * len(lines), 40)),
        dpi=110,
        facecolor="white",
        layout="constrained",
    )
    axes = figure.add_subplot()
    image = axes.imshow(
        values, vmin=0, vmax=max(100.0, float(np.nanmax(values, initial=100.0))), cmap="RdYlBu"
    )
    for line, column in product(range(len(lines)), range(len(columns))):
        value = values[line, column]
        axes.text(
            column, line, "–" if math.isnan(value) else f"{value:.0f}", ha="center", va="center", fontsize=8
        )
    axes.set_xticks(range(len(columns)), columns, fontsize=8, color=INK)
    axes.set_yticks(range(len(lines)), lines, fontsize=8, color=INK)
    axes.set_xlabel(" / ".join(grid.factors), color=SOFT)
    axes.tick_params(length=0)
    axes.set_aspect("auto")
    figure.colorbar(image, ax=axes, label="mAP ratio in %")
    return figure


def draw_level_curves(grid: GridFile, groups: Sequence[GridGroup], factor: str) -> Figure:
    """mAP ratio over the levels of a factor: a line for each attack, defence and level of other factors."""
    figure = Figure(figsize=(8, 4.6), dpi=110, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    plain_axes(axes)
    place = list(grid.factors).index(factor)
    labels = [label for label, _ in grid.levels(factor)]
    is_number = all(isinstance(label, int | float) for label in labels)
    lines: dict[str, list[tuple[float, GridGroup]]] = {}
    for group in groups:
        levels, attack, _, defence = group.key
        others = [
            f"{name} {label}" for name, label in zip(grid.factors, levels, strict=True) if name != factor
        ]
        x = levels[place] if is_number else labels.index(levels[place])
        assert isinstance(x, int | float)
        name = ", ".join([f"{attack}{_under(defence)}", *others])
        lines.setdefault(name, []).append((float(x), group))
    axes.axhline(100, color=LINE, linewidth=1, zorder=1)
    styles = zip(cycle(COLOURS), cycle(MARKS), strict=False)
    for (name, line), (colour, mark) in zip(list(lines.items())[:MOST_LINES], styles, strict=False):
        ordered = sorted(line, key=lambda point: point[0])
        ratios = [group.ratio() for _, group in ordered]
        x = [each for each, _ in ordered]
        axes.plot(x, [each.percent for each in ratios], f"{mark}-", color=colour, markersize=5, label=name)
        for each, ratio in zip(x, ratios, strict=True):
            if ratio.ci95 is not None:
                axes.plot([each, each], ratio.ci95, color=colour, linewidth=3, alpha=0.3, zorder=2)
    if len(lines) > MOST_LINES:
        axes.set_title(f"the first {MOST_LINES} of {len(lines)} lines; the table has all", fontsize=9)
    if not is_number:
        axes.set_xticks(range(len(labels)), [str(label) for label in labels], fontsize=9)
    axes.set_ylim(bottom=0)
    axes.set_xlabel(factor, color=SOFT)
    axes.set_ylabel("mAP ratio in %", color=SOFT)
    handles, names = axes.get_legend_handles_labels()
    figure.legend(
        handles, names, loc="outside lower center", ncols=2, frameon=False, fontsize=8, labelcolor=INK
    )
    return figure


def _under(defence: str) -> str:
    return "" if defence == UNDEFENDED else f" under {defence}"
