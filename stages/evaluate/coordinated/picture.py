"""A coordinated attack on one time axis: the attacks on a vehicle and their effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.ticker import MaxNLocator

from advpipe.stages.evaluate.coordinated.attack_timeline import AttackTimeline
from advpipe.stages.evaluate.coordinated.effects import BelievedTrack, Effect
from advpipe.stages.evaluate.report.style import BASELINE, INK, LINE, PREDICTION, SOFT, plain_axes

if TYPE_CHECKING:
    from advpipe.pipeline.core.figure import Figure

SHADE = "#fbe3e4"

TIMES = LinearSegmentedColormap.from_list("times", ["#3f6fb5", "#2a9d8f", "#d99a1c", "#d1495b"])
"""Colours that are seen on white and on dark pages."""

WIDTH_IN, STRIP_IN, MAP_IN = 8.2, 0.1, 1.5
LEFT_IN, TOP_IN, GAP_IN, MAP_GAP_IN, BOTTOM_IN = 1.7, 0.3, 0.13, 0.8, 0.5
LETTER_IN = 0.074
CELLS, MOST_DOTS, MOST_LINES = 60, 150, 30


def draw_coordinated(
    timelines: Sequence[AttackTimeline],
    effects: Sequence[Effect],
    together_ns: tuple[int, int] | None,
    start_ns: int,
    track: BelievedTrack | None = None,
) -> Figure:
    """A line for each attacked fix, message and cloud, and the effects below; shaded: all attacks are active.

    together_ns: first and last time of the shaded span, None for none. start_ns: of the recording. track:
    where the vehicle was and believed to be, drawn as a map whose colours are those of the time axis.
    """
    names = [f"{' + '.join(one.attacks)}: {one.what}" for one in timelines]
    heights = [0.1 + 0.21 * len(timelines), *(0.42 for _ in effects)]
    heights += [] if track is None else [STRIP_IN, MAP_IN]
    figure, axes_below = _stacked(heights, max(map(len, names)))
    panels = axes_below[: 1 + len(effects)]
    for axes in panels[1:]:
        axes.sharex(panels[0])
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    for axes in panels:
        plain_axes(axes)
        if together_ns is not None:
            begin_s, end_s = ((ns - start_ns) / 1e9 for ns in together_ns)
            axes.axvspan(begin_s, end_s, color=SHADE, linewidth=0, zorder=0)
    events, *curves = panels
    rows = range(len(timelines))[::-1]
    for row, one in zip(rows, timelines, strict=True):
        times_s = (one.times_ns - start_ns) / 1e9
        events.eventplot(times_s, lineoffsets=row, linelengths=0.7, linewidths=1.0, colors=PREDICTION)
    events.set_yticks(list(rows), names)
    events.set_ylim(-0.6, len(timelines) - 0.4)
    for axes, effect in zip(curves, effects, strict=True):
        _draw_effect(axes, effect, start_ns)
    if curves:
        handles, labels = curves[0].get_legend_handles_labels()
        panels[0].legend(
            handles, labels, fontsize=9, frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(0, 1),
            borderaxespad=0,
        )  # fmt: skip
    last = panels[-1]
    if track is not None:
        last.tick_params(labelbottom=False)
        last, on_map = axes_below[-2:]
        last.sharex(panels[0])
        colours = Normalize(*((ns - start_ns) / 1e9 for ns in track.times_ns[[0, -1]]))
        _draw_strip(last, colours)
        _draw_track(on_map, track, start_ns, colours)
    last.set_xlabel("time of the recording [s]; shaded: all attacks are active", color=SOFT)
    return figure


def _stacked(heights_in: Sequence[float], characters: int) -> tuple[Figure, list[Axes]]:
    """A figure and panels of these heights below each other; a map is farther down.

    characters: of the longest label on the left. The places are computed here rather than by a solver, whose
    results differ in their last digits from call to call.
    """
    from advpipe.pipeline.core.figure import Figure

    left_in = max(LEFT_IN, LETTER_IN * characters + 0.2)
    gaps = [TOP_IN, *([GAP_IN] * (len(heights_in) - 1))]
    if heights_in[-1] == MAP_IN:
        gaps[-1] = MAP_GAP_IN
    total = sum(heights_in) + sum(gaps) + BOTTOM_IN
    figure = Figure(figsize=(WIDTH_IN, total), dpi=110, facecolor="white")
    panels, top = [], total
    for height, gap in zip(heights_in, gaps, strict=True):
        top -= gap + height
        place = (left_in / WIDTH_IN, top / total, (WIDTH_IN - left_in - 0.15) / WIDTH_IN, height / total)
        panels.append(figure.add_axes(place))
    return figure, panels


def _draw_strip(axes: Axes, colours: Normalize) -> None:
    """The colours of the map along the time axis."""
    edges_s = np.linspace(colours.vmin or 0.0, colours.vmax or 1.0, CELLS + 1)
    middles_s = (edges_s[1:] + edges_s[:-1]) / 2
    plain_axes(axes)
    axes.pcolormesh(edges_s, [0, 1], middles_s[None], cmap=TIMES, norm=colours)
    axes.set_yticks([0.5], ["colour on the map"])


def _draw_track(axes: Axes, track: BelievedTrack, start_ns: int, colours: Normalize) -> None:
    """The true and the believed positions, turned so that the drive goes to the right."""
    ahead_m = track.true_m[-1] - track.true_m[0]
    yaw_rad = float(np.arctan2(ahead_m[1], ahead_m[0]))
    turned_R_map = np.array([[np.cos(yaw_rad), np.sin(yaw_rad)], [-np.sin(yaw_rad), np.cos(yaw_rad)]])
    true_m, believed_m = (
        (each - track.true_m[0]) @ turned_R_map.T for each in (track.true_m, track.believed_m)
    )
    times_s = (track.times_ns - start_ns) / 1e9
    plain_axes(axes)
    seconds = np.unique(np.searchsorted(times_s, np.arange(np.ceil(times_s[0]), times_s[-1])))
    for each in seconds[:: max(1, len(seconds) // MOST_LINES)]:
        axes.plot(*np.stack([true_m[each], believed_m[each]]).T, color=LINE, linewidth=0.8, zorder=1)
    shown = slice(None, None, max(1, len(times_s) // MOST_DOTS))
    for positions_m, marker, area, label in (
        (true_m, "s", 14, "true position"),
        (believed_m, "o", 7, "position that it believes in; a line joins the two at a full second"),
    ):
        x_m, y_m = positions_m[shown].T
        axes.scatter(
            x_m, y_m, c=times_s[shown], cmap=TIMES, norm=colours, s=area, marker=marker,
            linewidths=0, label=label, zorder=2,
        )  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("along the drive [m]", color=SOFT)
    axes.set_ylabel("across [m]", color=SOFT)
    axes.legend(fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)


def _draw_effect(axes: Axes, effect: Effect, start_ns: int) -> None:
    """The attacked values in red upon wider clean ones in grey."""
    for series, colour, label, width in (
        (effect.clean, BASELINE, "clean", 3.0),
        (effect.attacked, PREDICTION, "attacked", 1.2),
    ):
        times_s = (series.times_ns - start_ns) / 1e9
        if effect.is_by_cloud:
            axes.vlines(times_s, 0, series.values, colors=colour, linewidth=width)
            axes.plot(times_s, series.values, "o", color=colour, markersize=2 + width, label=label)
        else:
            axes.plot(times_s, series.values, color=colour, label=label, linewidth=width)
    axes.set_ylabel(effect.short_title, rotation=0, ha="right", va="center", fontsize=9, color=INK)
    axes.yaxis.set_major_locator(MaxNLocator(2, integer=True))
    axes.set_ylim(bottom=0)
