"""A coordinated attack on one time axis: the attacks on a vehicle and their effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from advpipe.stages.evaluate.coordinated.attack_timeline import AttackTimeline
from advpipe.stages.evaluate.coordinated.effects import Effect
from advpipe.stages.evaluate.report.style import BASELINE, INK, PREDICTION, SOFT, plain_axes

if TYPE_CHECKING:
    from advpipe.pipeline.core.figure import Figure

SHADE = "#fbe3e4"


def draw_coordinated(
    timelines: Sequence[AttackTimeline],
    effects: Sequence[Effect],
    together_ns: tuple[int, int] | None,
    start_ns: int,
) -> Figure:
    """A line for each attacked fix, message and cloud, and the effects below; shaded: all attacks are active.

    together_ns: first and last time of the shaded span, None for none. start_ns: of the recording.
    """
    from advpipe.pipeline.core.figure import Figure

    heights = [0.1 + 0.21 * len(timelines), *(0.52 for _ in effects)]
    size = (11.0, sum(heights) + 0.75)
    figure = Figure(figsize=size, dpi=110, facecolor="white", layout="constrained")
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[
        :, 0
    ].tolist()
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
    events.set_yticks(list(rows), [f"{' + '.join(one.attacks)}: {one.what}" for one in timelines])
    events.set_ylim(-0.6, len(timelines) - 0.4)
    for axes, effect in zip(curves, effects, strict=True):
        _draw_effect(axes, effect, start_ns)
    if curves:
        handles, labels = curves[0].get_legend_handles_labels()
        figure.legend(handles, labels, fontsize=9, frameon=False, loc="lower left", ncols=1)
    panels[-1].set_xlabel("time of the recording [s]; shaded: all attacks are active", color=SOFT)
    return figure


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
