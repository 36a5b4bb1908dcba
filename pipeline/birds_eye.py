"""Draws clouds and boxes in bird's-eye view on matplotlib axes; forward is up."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]
Limits = tuple[float, float, float, float]
"""x_min, x_max, y_min, y_max in the LiDAR's frame, in metres."""

TRUTH = "#1d5fd1"
REMOVED, ADDED, MOVED = "#f08c00", "#c2189b", "#7a3ff2"
INK, SOFT, LINE = "#1b2430", "#5c6876", "#c9d1da"
HEIGHTS = LinearSegmentedColormap.from_list("heights", ["#c3cad3", "#8d98a6", "#4a5766", "#141b24"])


def prepare_axes(axes: Axes, limits: Limits) -> None:
    """Set the axes to equal scale, without ticks, with y pointing left."""
    axes.set_aspect("equal")
    axes.set_xlim(limits[3], limits[2])
    axes.set_ylim(limits[0], limits[1])
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(LINE)


def draw_points(axes: Axes, cloud: Cloud, limits: Limits, area: float) -> None:
    """Draw the points of a cloud (N,) within the limits; higher points are darker. area: size in points²."""
    points = xyz(cloud)
    x, y = points[:, 0], points[:, 1]
    points = points[(x > limits[0]) & (x < limits[1]) & (y > limits[2]) & (y < limits[3])]
    if not len(points):
        return
    ground_m = float(np.quantile(points[:, 2], 0.05))
    points = points[np.argsort(points[:, 2], kind="stable")]  # high ones on top
    axes.scatter(
        points[:, 1], points[:, 0], s=area, c=points[:, 2], cmap=HEIGHTS, vmin=ground_m, vmax=ground_m + 2.2,
        linewidths=0, rasterized=True, zorder=2,
    )  # fmt: skip


def draw_boxes(
    axes: Axes,
    boxes: Float64,
    colour: str,
    width: float,
    *,
    linestyle: str = "solid",
    alpha: float = 1.0,
    grow_m: float = 0.0,
    heading: bool = True,
) -> None:
    """Draw the outlines of boxes (K, 7), enlarged by `grow_m`, with a short line out of the front."""
    if not len(boxes):
        return
    grown = boxes.copy()
    grown[:, 3:5] += 2 * grow_m
    corners = box_corners(grown)[:, :4, :2]
    lines = [np.append(c, c[:1], axis=0)[:, ::-1] for c in corners]
    if heading:
        front = (corners[:, 0] + corners[:, 3]) / 2
        tip = front + 0.35 * (front - grown[:, :2])
        lines += [np.stack([a, b])[:, ::-1] for a, b in zip(front, tip, strict=True)]
    axes.add_collection(
        LineCollection(lines, colors=colour, linewidths=width, linestyles=linestyle, alpha=alpha, zorder=4)
    )


def draw_rings(axes: Axes, limits: Limits) -> None:
    """Draw circles every 20 m around the sensor, and the sensor as an arrow."""
    angle = np.linspace(0, 2 * np.pi, 361)
    farthest = np.hypot(max(abs(limits[0]), abs(limits[1])), max(abs(limits[2]), abs(limits[3])))
    for radius in range(20, int(farthest) + 1, 20):
        axes.plot(
            radius * np.sin(angle), radius * np.cos(angle), color="#dbe1e8", linewidth=0.8, zorder=1,
            scalex=False, scaley=False,
        )  # fmt: skip
        if limits[0] < radius < limits[1] - 1:
            axes.text(
                0, radius, f"{radius} m", fontsize=8, color="#7b8794", ha="center", va="center", zorder=5,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
            )  # fmt: skip
    axes.fill([0.0, 1.1, 0.0, -1.1], [2.4, -1.6, -0.7, -1.6], color=INK, zorder=6)
