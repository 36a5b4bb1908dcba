"""What a vehicle hears of in CPMs at one instant, as a picture: road users, and objects honest and false."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.stages.evaluate.cooperative.heard_checks import Bool
from advpipe.stages.evaluate.cooperative.heard_scenes import NEAR_M, HeardScene
from advpipe.stages.evaluate.report.style import BASELINE, INK, LINE, PREDICTION, SOFT, TRUTH, plain_axes

if TYPE_CHECKING:
    from advpipe.pipeline.core.figure import Figure

UNSTATED_M = 1.0
"""Length and width of an object whose CPM states none."""


def draw_heard(scene: HeardScene, attacked: Bool) -> Figure:
    """Road users in blue outlines, with the own LiDAR's points; heard objects filled: honest ones in grey,
    those that an attack added or changed in red. attacked: (H,) of the heard ones."""
    from matplotlib.collections import PolyCollection

    from advpipe.pipeline.core.figure import Figure

    figure = Figure(figsize=(7.0, 6.6), dpi=110, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    plain_axes(axes)
    points_m = transform_points(invert(scene.lidar_SE3_map), scene.cloud_m)[:, :2] - scene.at_m
    near_m = points_m[np.abs(points_m).max(axis=1, initial=0) < NEAR_M]
    axes.scatter(near_m[:, 0], near_m[:, 1], s=0.4, color=LINE, linewidths=0, rasterized=True, zorder=1)
    heard = np.array(
        [
            [*at_m, *(_size_m(value) for value in (one.length_m, one.width_m)), one.yaw_rad]
            for one, at_m in zip(scene.heard, scene.heard_m, strict=True)
        ]
    ).reshape(-1, 5)
    for label, chosen, colour in (("honest", ~attacked, BASELINE), ("false", attacked, PREDICTION)):
        boxes = _corners_m(heard[chosen], scene.at_m)
        name = f"{label} object in CPMs"
        drawn = PolyCollection(boxes, label=name, facecolor=colour, edgecolor=colour, alpha=0.75, zorder=3)
        axes.add_collection(drawn)
    users = _corners_m(scene.users[:, [0, 1, 3, 4, 6]], scene.at_m)
    axes.add_collection(PolyCollection(users, label="road user", facecolor="none", edgecolor=TRUTH, zorder=4))
    axes.plot(0, 0, "^", color=INK, markersize=8, label="the vehicle itself", zorder=5)
    axes.set(xlim=(-NEAR_M, NEAR_M), ylim=(-NEAR_M, NEAR_M), aspect="equal")
    axes.set_xlabel("east of the vehicle [m]", color=SOFT)
    axes.set_ylabel("north [m]", color=SOFT)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _size_m(value: float) -> float:
    return value if math.isfinite(value) else UNSTATED_M


def _corners_m(boxes: Float64, at_m: Float64) -> list[Float64]:
    """The corners (4, 2) of boxes (B, 5: x, y, length, width, yaw), relative to a place."""
    found = []
    for x_m, y_m, length_m, width_m, yaw_rad in boxes:
        cosine, sine = (math.cos(yaw_rad), math.sin(yaw_rad)) if math.isfinite(yaw_rad) else (1.0, 0.0)
        halves_m = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length_m / 2, width_m / 2)
        found.append(halves_m @ np.array([[cosine, sine], [-sine, cosine]]) + (x_m, y_m) - at_m)
    return found
