"""Trajectories true, reported and estimated, and the error over time with the attack's spans shaded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from advpipe.stages.evaluate.localisation.figures import gate
from advpipe.stages.evaluate.localisation.track import Bool, Track
from advpipe.stages.evaluate.report.style import BASELINE, INK, LOST, PREDICTION, TRUTH, plain_axes

SHADE = "#fbe3e4"


def draw_localisation(clean: Track, adversarial: Track, attacked: Bool) -> Figure:
    """attacked: (K,), the steps whose fix is false or missing."""
    figure = Figure(figsize=(11, 5.2), dpi=110, facecolor="white", layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.2))
    _draw_map(figure.add_subplot(grid[:, 0]), clean, adversarial, attacked)
    error, innovation = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    time_s = (clean.times_ns - clean.times_ns[0]) / 1e9
    for axes in (error, innovation):
        plain_axes(axes)
        for begin, end in spans(attacked):
            step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
            axes.axvspan(time_s[begin], time_s[end] + step_s, color=SHADE, linewidth=0, zorder=0)
        axes.set_xlim(time_s[0], time_s[-1])
    _draw_error(error, time_s, clean, adversarial)
    _draw_innovation(innovation, time_s, clean, adversarial)
    return figure


def spans(attacked: Bool) -> Iterator[tuple[int, int]]:
    """First and last step of each run of attacked ones; steps between two fixes do not part a run of many.

    Runs are joined over gaps as long as the median distance of two attacked steps.
    """
    (steps,) = np.nonzero(attacked)
    if not len(steps):
        return
    gaps = np.diff(steps)
    usual = float(np.median(gaps)) if len(gaps) else 1.0
    parts = np.split(steps, np.nonzero(gaps > usual)[0] + 1)
    yield from ((int(part[0]), int(part[-1])) for part in parts)


def _draw_map(axes: Axes, clean: Track, adversarial: Track, attacked: Bool) -> None:
    plain_axes(axes)
    fix_m = adversarial.fix_m
    false = attacked & np.isfinite(fix_m[:, 0])
    genuine = ~attacked & np.isfinite(fix_m[:, 0])
    axes.plot(*clean.true_m[:, :2].T, color=TRUTH, linewidth=2.5, label="true")
    axes.plot(*fix_m[genuine][:, :2].T, ".", color=BASELINE, markersize=2.5, label="reported")
    axes.plot(*fix_m[false][:, :2].T, ".", color=LOST, markersize=3.5, label="reported, false")
    axes.plot(*adversarial.estimate_m[:, :2].T, color=PREDICTION, linewidth=1.2, label="estimated")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(frameon=False, fontsize=9)


def _draw_error(axes: Axes, time_s: np.ndarray, clean: Track, adversarial: Track) -> None:
    for track, colour, label in ((adversarial, PREDICTION, "attacked"), (clean, INK, "clean")):
        axes.plot(time_s, np.linalg.norm(track.error_m[:, :2], axis=1), color=colour, label=label)
    axes.plot(time_s, np.abs(adversarial.lateral_m), ":", color=PREDICTION, label="attacked, sideways")
    axes.set(ylabel="error of the estimate [m]")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=9)


def _draw_innovation(axes: Axes, time_s: np.ndarray, clean: Track, adversarial: Track) -> None:
    for track, colour in ((adversarial, PREDICTION), (clean, INK)):
        known = np.isfinite(track.nis)
        axes.plot(time_s[known], np.maximum(track.nis[known], 1e-2), ".", color=colour, markersize=2.5)
    axes.axhline(gate(), color=BASELINE, linewidth=1)
    axes.annotate("threshold", (time_s[0], gate()), (3, 3), textcoords="offset points", fontsize=8)
    axes.set_yscale("log")
    axes.set(xlabel="time [s]", ylabel="innovation squared, normalised")
