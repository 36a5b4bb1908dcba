"""A drive's V2X as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.v2x.statistics import BIN_M, INTERVAL_BIN_S, Statistics

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOUR, PALE = "#2b6cb0", "#bcd3ea"


def draw_statistics(statistics: Statistics, title: str = "") -> Figure:
    """Packet delivery ratio by distance, intervals between CAMs, channel busy ratio over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.6), layout="constrained")
    delivery, intervals, load = figure.subplots(1, 3)
    _draw_delivery(delivery, statistics)
    _draw_intervals(intervals, statistics)
    _draw_load(load, statistics)
    for axes in (delivery, intervals, load):
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_ylim(bottom=0)
    if title:
        figure.suptitle(title)
    return figure


def _draw_delivery(axes: Axes, statistics: Statistics) -> None:
    ratio = statistics.delivery_ratio
    middle_m = (np.arange(len(ratio)) + 0.5) * BIN_M
    known = np.isfinite(ratio)
    axes.plot(middle_m[known], 100 * ratio[known], color=COLOUR, marker="o", markersize=3)
    axes.set(xlabel="distance [m]", ylabel="packets delivered [%]", ylim=(0, 102), xlim=(0, None))


def _draw_intervals(axes: Axes, statistics: Statistics) -> None:
    begin_s = np.arange(len(statistics.intervals)) * INTERVAL_BIN_S
    axes.bar(begin_s, statistics.intervals, INTERVAL_BIN_S, align="edge", color=COLOUR)
    axes.set(xlabel="time since the station's last CAM [s]", ylabel="CAMs", xlim=(0, None))


def _draw_load(axes: Axes, statistics: Statistics) -> None:
    first_ns = statistics.busy_ns[0] if statistics.busy_ns else 0
    time_s = (np.array(statistics.busy_ns, np.int64) - first_ns) / 1e9
    axes.plot(time_s, 100 * np.array(statistics.busy_max), color=PALE, label="busiest station")
    axes.plot(time_s, 100 * np.array(statistics.busy_mean), color=COLOUR, label="mean of the stations")
    axes.set(xlabel="time [s]", ylabel="channel busy [%]")
    axes.legend(frameon=False)
