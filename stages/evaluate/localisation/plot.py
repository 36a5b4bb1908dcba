"""True, reported and estimated trajectories, and the error over time with the attacked spans shaded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes

from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.localisation.monitor import nis_threshold
from advpipe.stages.evaluate.localisation.track import Bool, LocalisationTrack
from advpipe.stages.evaluate.report.style import BASELINE, INK, LOST, PREDICTION, TRUTH, plain_axes

SHADE = "#fbe3e4"
LEAST_HALF_M = 8.0
"""Half the height of the map from near."""


def draw_localisation(
    clean: LocalisationTrack, adversarial: LocalisationTrack, attacked: Bool, of_what: str = "whole drive"
) -> Figure:
    """Trajectories and errors of both tracks.

    attacked: (K,), the steps whose fix is false or missing. of_what: the part of the drive that they cover.
    """
    figure = Figure(figsize=(11.5, 5.4), dpi=110, facecolor="white", layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.2))
    whole, near = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    for axes in (whole, near):
        _draw_map(axes, clean, adversarial, attacked)
    _zoom(whole, near, adversarial)
    whole.set_title(f"the {of_what}", loc="left", fontsize=10, color=INK)
    error, innovation = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    time_s = (clean.times_ns - clean.times_ns[0]) / 1e9
    for axes in (error, innovation):
        plain_axes(axes)
        for nth, (begin, end) in enumerate(spans(attacked)):
            step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
            label = "_" if nth else "attacked fixes"
            axes.axvspan(time_s[begin], time_s[end] + step_s, color=SHADE, linewidth=0, zorder=0, label=label)
        if len(time_s) > 1:
            axes.set_xlim(time_s[0], time_s[-1])
    _draw_error(error, time_s, clean, adversarial)
    _draw_innovation(innovation, time_s, clean, adversarial)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=4, frameon=False, fontsize=9)
    handles, labels = error.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=4, frameon=False, fontsize=9)
    return figure


def spans(attacked: Bool) -> Iterator[tuple[int, int]]:
    """First and last step of each run of attacked ones; steps between two fixes do not interrupt a run.

    Runs are joined over gaps as long as the median distance of two attacked steps.
    """
    (steps,) = np.nonzero(attacked)
    if not len(steps):
        return
    gaps = np.diff(steps)
    usual = float(np.median(gaps)) if len(gaps) else 1.0
    parts = np.split(steps, np.nonzero(gaps > usual)[0] + 1)
    yield from ((int(part[0]), int(part[-1])) for part in parts)


def _draw_map(axes: Axes, clean: LocalisationTrack, adversarial: LocalisationTrack, attacked: Bool) -> None:
    plain_axes(axes)
    fix_m = adversarial.fix_m
    false = attacked & np.isfinite(fix_m[:, 0])
    genuine = ~attacked & np.isfinite(fix_m[:, 0])
    axes.plot(*clean.true_m[:, :2].T, color=TRUTH, linewidth=2.5, label="true")
    axes.plot(*adversarial.estimate_m[:, :2].T, color=PREDICTION, linewidth=1.2, label="estimated")
    axes.plot(*fix_m[genuine][:, :2].T, ".", color=BASELINE, markersize=3, label="reported")
    axes.plot(*fix_m[false][:, :2].T, ".", color=LOST, markersize=4, label="reported, false")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")


def _zoom(whole: Axes, near: Axes, track: LocalisationTrack) -> None:
    """Show the surroundings of the largest error in the second map, and mark them in the first."""
    off_m = np.linalg.norm(track.error_m[:, :2], axis=1)
    worst = int(np.argmax(off_m))
    ends_m = np.array([track.true_m[worst, :2], track.estimate_m[worst, :2]])
    middle_m, half_m = ends_m.mean(axis=0), max(0.8 * off_m[worst], LEAST_HALF_M)
    near.plot(*ends_m.T, color=INK, linewidth=1, linestyle="dashed")
    near.annotate(
        f"{off_m[worst]:.1f} m", ends_m[1], (14, -16), textcoords="offset points", fontsize=9, color=INK,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
    )  # fmt: skip
    near.set_xlim(middle_m[0] - 2 * half_m, middle_m[0] + 2 * half_m)
    near.set_ylim(middle_m[1] - half_m, middle_m[1] + half_m)
    near.set_aspect("equal", adjustable="box")
    near.set_title("around the largest error", loc="left", fontsize=10, color=INK)
    corners_m = np.array([(-2, -1), (2, -1), (2, 1), (-2, 1), (-2, -1)]) * half_m + middle_m
    whole.plot(*corners_m.T, color=INK, linewidth=0.8)


def _draw_error(
    axes: Axes, time_s: np.ndarray, clean: LocalisationTrack, adversarial: LocalisationTrack
) -> None:
    for track, colour, label in ((adversarial, PREDICTION, "attacked"), (clean, INK, "clean")):
        axes.plot(time_s, np.linalg.norm(track.error_m[:, :2], axis=1), color=colour, label=label)
    axes.plot(time_s, np.abs(adversarial.lateral_m), ":", color=PREDICTION, label="attacked, lateral")
    axes.set(ylabel="error of the estimate [m]")
    axes.set_ylim(bottom=0)


def _draw_innovation(
    axes: Axes, time_s: np.ndarray, clean: LocalisationTrack, adversarial: LocalisationTrack
) -> None:
    differs = adversarial.nis != clean.nis  # equal values are drawn for the clean bag only
    for track, colour, chosen in ((clean, INK, True), (adversarial, PREDICTION, differs)):
        known = np.isfinite(track.nis) & chosen
        axes.plot(time_s[known], np.maximum(track.nis[known], 1e-2), ".", color=colour, markersize=2.5)
    axes.axhline(nis_threshold(), color=BASELINE, linewidth=1)
    axes.annotate(
        f"threshold {nis_threshold():.1f}",
        (time_s[0], nis_threshold()),
        (3, 3),
        textcoords="offset points",
        fontsize=8,
    )
    axes.set_yscale("log")
    axes.set(xlabel="time [s]", ylabel="innovation squared, normalised")
