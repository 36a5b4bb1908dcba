"""The training log: one CSV row a step, and the curve as a picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

LOSSES = ("loss", "score_loss", "box_loss", "direction_loss", "quality_loss")
COLUMNS = ("step", "learning_rate", *LOSSES, "gradient_norm")


class TrainLog:
    """Rows of `COLUMNS`, appended step by step; steps from `first_step` on are written anew."""

    def __init__(self, path: Path, first_step: int) -> None:
        rows = []
        if path.is_file() and first_step:
            with path.open(newline="") as file:
                rows = [row for row in list(csv.reader(file))[1:] if len(row) == len(COLUMNS)]
        self.path = path
        self._file = path.open("w", newline="")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow(COLUMNS)
        self._writer.writerows(row for row in rows if int(row[0]) < first_step)

    def add(self, step: int, *values: float) -> None:
        self._writer.writerow([step, *(f"{value:.6g}" for value in values)])
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def plot_losses(log: Path, picture: Path) -> None:
    """The losses over the steps, smoothed over about a fiftieth of the run."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    table = np.genfromtxt(log, delimiter=",", names=True, ndmin=1)
    width = max(1, len(table) // 50)
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    for name in LOSSES:
        if not table[name].any():  # no curve on a logarithmic axis
            continue
        smooth = np.convolve(table[name], np.ones(width) / width, mode="valid")
        axes.plot(table["step"][width - 1 :], smooth, label=name.replace("_", " "))
    axes.set(xlabel="step", ylabel="loss", yscale="log", title="Training loss")
    axes.grid(alpha=0.3)
    axes.legend()
    FigureCanvasAgg(figure).print_png(picture)  # type: ignore[no-untyped-call]
