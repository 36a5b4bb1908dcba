"""A radar under attack over time: road users detected, and ghosts."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.radar.scan_scores import ScanTotals
from advpipe.stages.evaluate.report.style import INK, PREDICTION, SOFT, plain_axes

SHADE = "#fbe3e4"


def draw_radar(totals: ScanTotals, start_ns: int) -> Figure:
    """Road users detected and ghosts of each scan, clean and attacked; shaded: attacked scans."""
    figure = Figure(figsize=(8.2, 3.6), dpi=110, facecolor="white", layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    times_s = (np.array(totals.times_ns, np.int64) - start_ns) / 1e9
    step_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.1
    attacked = np.isin(totals.times_ns, totals.attacked_ns)
    series = ((above, totals.found_series), (below, totals.ghost_series))
    for axes, values in series:
        plain_axes(axes)
        clean, adversarial = np.array(values).reshape(-1, 2).T
        axes.fill_between(
            times_s, 0, 1, where=attacked, step="mid", color=SHADE, linewidth=0, zorder=0,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
        axes.step(times_s, clean, where="mid", color=INK, linewidth=1, label="clean")
        axes.step(times_s, adversarial, where="mid", color=PREDICTION, linewidth=1, label="attacked")
        axes.set_ylim(bottom=0)
    above.set_ylabel("road users\ndetected")
    below.set_ylabel("ghosts: moving\nreturns elsewhere")
    below.set_xlabel("time of the recording [s]; shaded: attacked scans", color=SOFT)
    if len(times_s):
        below.set_xlim(times_s[0] - step_s / 2, times_s[-1] + step_s / 2)
    above.legend(fontsize=9, frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0)
    return figure
