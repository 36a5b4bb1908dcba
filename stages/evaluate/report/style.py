"""Colours and axes that the pictures of a report share."""

from __future__ import annotations

from matplotlib.axes import Axes

from advpipe.pipeline.birds_eye import INK, LINE, SOFT, TRUTH

__all__ = [
    "BASELINE",
    "CLASS_COLOURS",
    "DISPLACED",
    "INK",
    "LINE",
    "LOST",
    "PREDICTION",
    "SOFT",
    "TRUTH",
    "plain_axes",
]

PREDICTION, LOST, DISPLACED = "#d61f26", "#f08c00", "#0a7f7f"
"""Truth is in blue and predictions in red, as in the paper's figures."""

BASELINE = "#7b8794"

CLASS_COLOURS = {"car": "#1b2430", "truck": "#0b8a8a", "cyclist": "#c26a00", "pedestrian": "#7a3ff2"}


def plain_axes(axes: Axes) -> None:
    """Axes with a faint grid and no frame at the top and on the right."""
    axes.grid(color="#eceff3", zorder=0)
    axes.set_axisbelow(True)
    axes.tick_params(length=0, labelsize=9, labelcolor=INK)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(LINE)
