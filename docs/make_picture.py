"""Makes docs/images/attack.gif: the same drive clean and after an attack, from above, with what is found.

The committed picture is of these two commands; every second frame of them keeps it below 1 MB:

    advpipe simulate district --set simulation.duration_s=4
    advpipe attack datasets/district --type detach --ratio 0.01 --frames ::2
    python docs/make_picture.py datasets/district

An object counts as missed where no detection of at least `LEAST_SCORE` has its centre within `NEAR_M`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from advpipe.pipeline.bag.frames import Frame, read_frames
from advpipe.pipeline.birds_eye import INK, REMOVED, TRUTH, draw_boxes, draw_points, prepare_axes
from advpipe.pipeline.detector.registry import load_detector

LIMITS = (-22.0, 30.0, -22.0, 22.0)
FOUND = "#d4262c"
LEAST_SCORE, NEAR_M = 0.24, 1.5
PERIOD_S = 0.4


def main(dataset: Path, target: Path) -> None:
    """Draws every second frame that the first adversarial bag of the data set holds."""
    adversarial = sorted(path for path in dataset.glob("detach-*") if path.is_dir())[0]
    attacked = list(read_frames(adversarial))[::2]
    stamps = {frame.stamp_ns for frame in attacked}
    clean = [frame for frame in read_frames(dataset / "clean") if frame.stamp_ns in stamps]
    detector = load_detector("small")
    figure = make_figure()

    def draw(index: int) -> None:
        for axes, frame, title in zip(
            figure.axes, (clean[index], attacked[index]), ("clean", "1 % of the points removed"), strict=True
        ):
            found = detector.detect(frame.cloud)
            draw_frame(axes, frame, found.boxes[found.scores >= LEAST_SCORE], title)

    animation = FuncAnimation(figure, draw, frames=len(clean), init_func=lambda: None)  # type: ignore[arg-type]
    target.parent.mkdir(parents=True, exist_ok=True)
    animation.save(target, PillowWriter(fps=1 / PERIOD_S), dpi=80)
    print(f"{target}: {target.stat().st_size / 1000:.0f} kB, {len(clean)} frames")


def make_figure() -> Figure:
    """Two panels side by side and one legend below."""
    figure, _ = pyplot.subplots(1, 2, figsize=(8, 5.1))
    figure.subplots_adjust(0.01, 0.07, 0.99, 0.93, wspace=0.03)
    keys = [Line2D([], [], color=colour, lw=2) for colour in (TRUTH, FOUND, REMOVED)]
    figure.legend(keys, ["ground truth", "detected", "missed"], loc="lower center", ncol=3, frameon=False)
    return figure


def draw_frame(axes: Axes, frame: Frame, found: np.ndarray, title: str) -> None:
    """The cloud, the road users with at least one point nearby, and the boxes that the detector found."""
    axes.clear()
    prepare_axes(axes, LIMITS)
    draw_points(axes, frame.cloud, LIMITS, 1.2)
    truth = frame.boxes.geometry
    is_seen = np.array([points_in(frame, box) >= 5 for box in truth], bool)
    is_found = np.array(
        [any(np.hypot(*(box[:2] - one[:2])) < NEAR_M for one in found) for box in truth], bool
    )
    draw_boxes(axes, truth[is_seen & is_found], TRUTH, 1.6)
    draw_boxes(axes, truth[is_seen & ~is_found], REMOVED, 2.4, linestyle="dashed", grow_m=0.4)
    draw_boxes(axes, found, FOUND, 1.2, heading=False)
    axes.set_title(title, fontsize=11, color=INK)


def points_in(frame: Frame, box: np.ndarray) -> int:
    """How many points of the cloud lie in a box (7,)."""
    x_m, y_m = frame.cloud["x"] - box[0], frame.cloud["y"] - box[1]
    cos, sin = np.cos(box[6]), np.sin(box[6])
    along, across = np.abs(x_m * cos + y_m * sin), np.abs(y_m * cos - x_m * sin)
    is_level = np.abs(frame.cloud["z"] - box[2]) <= box[5] / 2
    return int(((along <= box[3] / 2) & (across <= box[4] / 2) & is_level).sum())


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(__file__).parent / "images" / "attack.gif")
