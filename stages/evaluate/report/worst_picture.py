"""The worst frame on a report's first screen: before and after the attack, legible at its size there."""

from __future__ import annotations

import math

from advpipe.pipeline.birds_eye import INK, Limits
from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.birds_eye import draw_view, legend
from advpipe.stages.evaluate.report.scene import ReportScene, crop

WIDE_IN, TALL_IN = (11.2, 4.7), (5.6, 6.6)
"""Width and height, of panels beside each other and of panels one upon the other."""

EDGE_IN, TITLE_IN, LINE_IN = 0.05, 0.26, 0.2
TEXT_POINTS = 8.5


def draw_worst(scene: ReportScene, is_tall: bool) -> Figure:
    """The surroundings of the lost and displaced objects, clean and attacked; is_tall: for a narrow place."""
    width, height = TALL_IN if is_tall else WIDE_IN
    views = [("Clean", scene.before)]
    if scene.after is not None:
        views.append(("After the attack", scene.after))
    rows, columns = (len(views), 1) if is_tall else (1, len(views))
    entries = legend(scene)
    in_line = 2 if is_tall else math.ceil(len(entries) / 2)
    foot = LINE_IN * math.ceil(len(entries) / in_line) + 0.1
    panel_width = (width - EDGE_IN * (columns + 1)) / columns
    panel_height = (height - foot) / rows - TITLE_IN - EDGE_IN
    limits = _limits(scene, panel_width / panel_height)
    figure = Figure(figsize=(width, height), dpi=110, facecolor="white")
    for number, (label, view) in enumerate(views):
        row, column = divmod(number, columns)
        left = EDGE_IN + column * (panel_width + EDGE_IN)
        bottom = height - (row + 1) * (TITLE_IN + panel_height) - row * EDGE_IN
        axes = figure.add_axes((left / width, bottom / height, panel_width / width, panel_height / height))
        draw_view(axes, scene, view, limits, point_area=0.9, text_points=TEXT_POINTS)
        title = f"{label}   {len(view.cloud):,} points"
        axes.set_title(title, loc="left", fontsize=10, color=INK, pad=4)
    figure.legend(
        handles=entries, loc="lower center", ncols=in_line, frameon=False, fontsize=9, labelcolor=INK,
        bbox_to_anchor=(0.5, 0.0), borderaxespad=0.1, labelspacing=0.25, columnspacing=1.2,
    )  # fmt: skip
    return figure


def _limits(scene: ReportScene, aspect: float) -> Limits:
    """Around what the attack did, as wide to high as the panel."""
    hit = scene.lost if scene.displaced is None else scene.lost | scene.displaced
    chosen = hit if hit.any() else scene.truth.is_evaluated
    x_min, x_max, y_min, y_max = crop([scene.truth.boxes.geometry[chosen]], margin_m=6.0, least_m=30.0)
    height_m = max(x_max - x_min, (y_max - y_min) / aspect)
    x_m, y_m, width_m = (x_min + x_max) / 2, (y_min + y_max) / 2, height_m * aspect
    return x_m - height_m / 2, x_m + height_m / 2, y_m - width_m / 2, y_m + width_m / 2
