"""A plot of a drive's V2X statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.v2x.statistics import BIN_M, INTERVAL_BIN_S, Statistics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from advpipe.pipeline.core.figure import Figure

COLOUR, PALE = "#2b6cb0", "#bcd3ea"


def draw_statistics(statistics: Statistics, title: str = "") -> Figure:
    """CAM rates of the stations, times between CAMs, delivery by distance, channel busy ratio over time."""
    from advpipe.pipeline.core.figure import Figure

    figure = Figure(figsize=(9.6, 6.4), layout="constrained")
    panels = figure.subplots(2, 2).ravel().tolist()
    for axes, draw in zip(panels, (_draw_rates, _draw_intervals, _draw_delivery, _draw_load), strict=True):
        draw(axes, statistics)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_ylim(bottom=0)
    if title:
        figure.suptitle(title)
    return figure


def _draw_rates(axes: Axes, statistics: Statistics) -> None:
    rates_hz = np.minimum(statistics.rates_hz, 10.0)  # the last bar also holds higher, invalid rates
    axes.hist(rates_hz, bins=np.arange(0, 10.75, 0.5).tolist(), color=COLOUR)
    axes.set(xlabel="CAMs a second", ylabel="stations", xlim=(0, 10.5))


def _draw_delivery(axes: Axes, statistics: Statistics) -> None:
    ratio = statistics.delivery_ratio
    middle_m = (np.arange(len(ratio)) + 0.5) * BIN_M
    known = np.isfinite(ratio)
    axes.plot(middle_m[known], 100 * ratio[known], color=COLOUR, marker="o", markersize=3)
    axes.set(xlabel="distance [m]", ylabel="packets delivered [%]", ylim=(0, 102), xlim=(0, None))


def _draw_intervals(axes: Axes, statistics: Statistics) -> None:
    begin_s = np.arange(len(statistics.intervals)) * INTERVAL_BIN_S
    # CAMs come after whole tenths of a second: bars shifted half a bin to the left are centred on them.
    axes.bar(begin_s, statistics.intervals, 0.9 * INTERVAL_BIN_S, color=COLOUR)
    axes.set(xlabel="time since the station's last CAM [s]", ylabel="CAMs", xlim=(0, None))


def _draw_load(axes: Axes, statistics: Statistics) -> None:
    first_ns = statistics.busy_ns[0] if statistics.busy_ns else 0
    time_s = (np.array(statistics.busy_ns, np.int64) - first_ns) / 1e9
    axes.plot(time_s, 100 * np.array(statistics.busy_max), color=PALE, label="busiest station")
    axes.plot(time_s, 100 * np.array(statistics.busy_mean), color=COLOUR, label="mean of the stations")
    axes.set(xlabel="time [s]", ylabel="channel busy [%]")
    axes.set_ylim(top=1.3 * axes.get_ylim()[1])  # room for the legend
    axes.legend(frameon=False, loc="upper right")
