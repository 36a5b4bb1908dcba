"""What two vehicles see together, from above: by true poses, and by those that each bag reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from advpipe.pipeline.birds_eye import draw_boxes, draw_points, draw_rings, prepare_axes
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.evaluate.report.style import BASELINE, INK, LOST, PREDICTION, TRUTH

HALF_M = 45.0
LIMITS = -HALF_M, HALF_M, -HALF_M, HALF_M


@dataclass(frozen=True)
class Fused:
    """One instant in the frame of the vehicle that fuses. truth: (M, 7) boxes. poses: by the name of a bag,
    where its poses put the other's cloud, and the boxes (D, 7) found in both clouds together."""

    own: Cloud
    other: Cloud
    truth: Float64
    poses: Mapping[str, tuple[Float64, Float64]]


def draw_fused(fused: Fused, own: str, other: str) -> Figure:
    """A panel for each pose; forward is up. own, other: names of the vehicles."""
    count = len(fused.poses)
    figure = Figure(figsize=(4.4 * count, 5.2), dpi=110, facecolor="white", layout="constrained")
    panels: Sequence[Axes] = np.atleast_1d(figure.subplots(1, count)).tolist()
    for axes, (name, (own_SE3_other, found)) in zip(panels, fused.poses.items(), strict=True):
        _draw_panel(axes, fused, own_SE3_other, found)
        axes.set_title(name, loc="left", fontsize=11, color=INK)
    handles = [
        Line2D([], [], linestyle="none", marker="o", markersize=4, color=BASELINE, label=f"seen by {own}"),
        Line2D([], [], linestyle="none", marker="o", markersize=4, color=LOST, label=f"shared by {other}"),
        Line2D([], [], color=TRUTH, linewidth=2, label="truth"),
        Line2D([], [], color=PREDICTION, linewidth=1.2, label="found in both clouds"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=10)
    return figure


def _draw_panel(axes: Axes, fused: Fused, own_SE3_other: Float64, found: Float64) -> None:
    prepare_axes(axes, LIMITS)
    draw_rings(axes, LIMITS)
    draw_points(axes, fused.own, LIMITS, 0.5)
    shared_m = transform_points(own_SE3_other, xyz(fused.other))
    shared_m = shared_m[np.abs(shared_m[:, :2]).max(axis=1, initial=0) < HALF_M]
    axes.scatter(shared_m[:, 1], shared_m[:, 0], s=0.5, color=LOST, linewidths=0, rasterized=True, zorder=3)
    draw_boxes(axes, fused.truth, TRUTH, 2.0)
    draw_boxes(axes, found, PREDICTION, 1.2)
