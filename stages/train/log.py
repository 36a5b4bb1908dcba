"""The training log: a CSV row for each step and for each validation, and both as a picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.atomic_file import atomic_file
from advpipe.pipeline.geometry.boxes import CLASSES

VALIDATIONS = ("step", *CLASSES)
"""Strict 3D AP of each class in percent."""


def step_columns(loss_parts: tuple[str, ...]) -> tuple[str, ...]:
    """The columns of the log of steps, for a network whose loss is the sum of these parts."""
    return ("step", "learning_rate", "loss", *loss_parts, "gradient_norm")


class Log:
    """A CSV file of `columns`, appended row by row; rows from `first_step` on are removed first.

    A kill at any moment loses no earlier row.
    """

    def __init__(self, path: Path, columns: tuple[str, ...], first_step: int) -> None:
        rows = []
        if path.is_file() and first_step:
            with path.open(newline="") as file:
                rows = [row for row in list(csv.reader(file))[1:] if len(row) == len(columns)]
        with atomic_file(path) as beside, beside.open("w", newline="") as file:
            kept = (row for row in rows if int(row[0]) < first_step)
            csv.writer(file, lineterminator="\n").writerows([columns, *kept])
        self.path = path
        self._file = path.open("a", newline="")
        self._writer = csv.writer(self._file, lineterminator="\n")

    def add(self, step: int, *values: float) -> None:
        """Append a row."""
        self._writer.writerow([step, *(f"{value:.6g}" for value in values)])
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def plot_training(
    steps: Path, validations: Path, picture: Path, precision_label: str = "strict 3D AP in %"
) -> None:
    """The losses over the steps, smoothed over about a fiftieth of the run, and the average precision."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from advpipe.pipeline.core.figure import Figure

    losses, precision = (np.genfromtxt(f, delimiter=",", names=True, ndmin=1) for f in (steps, validations))
    width = max(1, len(losses) // 50)
    figure = Figure(figsize=(7, 7 if len(precision) else 4), layout="constrained")
    axes, *below = figure.subplots(2 if len(precision) else 1, sharex=True, squeeze=False)[:, 0]
    for name in (column for column in losses.dtype.names or () if column.endswith("loss")):
        if not losses[name].any():  # no curve on a logarithmic axis
            continue
        smooth = np.convolve(losses[name], np.ones(width) / width, mode="valid")
        axes.plot(losses["step"][width - 1 :], smooth, label=name.replace("_", " "))
    axes.set(ylabel="loss", yscale="log", title="Training")
    for lower in below:
        for name in CLASSES:
            lower.plot(precision["step"], precision[name], marker=".", label=name)
        lower.set(ylabel=f"{precision_label} on the validation drive", ylim=(0, 100))
    for axis in (axes, *below):
        axis.grid(alpha=0.3)
        axis.legend()
    (below or [axes])[-1].set_xlabel("step")
    with atomic_file(picture) as beside:
        FigureCanvasAgg(figure).print_png(beside)  # type: ignore[no-untyped-call]
