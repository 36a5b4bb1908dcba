"""Bird's-eye pictures: a frame before and after the attack, and a close-up of a lost object.

Forward is up. Truth in blue and predictions in red, as in the paper's figures; lost objects are
marked in orange, displaced ones in teal, each with score and IoU of the best box left of it.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from advpipe.pipeline.birds_eye import (
    ADDED,
    INK,
    MOVED,
    REMOVED,
    SOFT,
    TRUTH,
    Limits,
    draw_boxes,
    draw_points,
    draw_rings,
    prepare_axes,
)
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.evaluate.report.label_places import place_labels
from advpipe.stages.evaluate.report.scene import CloudView, ReportScene, crop
from advpipe.stages.evaluate.report.style import DISPLACED, LOST, PREDICTION

ZOOM_M = 12.0
"""Side of the picture of one object."""

SMALL_M2 = 4.0

LOST_TEXT = "#a85a00"
"""A darker orange, in which small texts are legible on white."""

LETTER = 0.6
"""Width of a letter by its height, about."""

LEAD = 6.0
"""A label that is farther from its object, in points, has a line to it."""

WIDTH_IN, HEAD_IN, FOOT_IN, CLEAN_IN = 15.0, 0.85, 0.55, 8.0


def draw_scene(scene: ReportScene) -> Figure:
    """A frame as a figure: before, after, and beside them a close-up of one lost object.

    A frame of a clean bag alone is one square panel.
    """
    evaluated = scene.truth.boxes.geometry[scene.truth.is_evaluated]
    if scene.after is None:
        shown = [evaluated, scene.before.predictions]
        return _draw_clean(scene, _square(crop(shown, margin_m=6.0, least_m=50.0)))
    limits = crop([evaluated], margin_m=8.0, least_m=50.0)
    focus = _focus(scene)
    views = [("Clean", scene.before), ("After the attack", scene.after)]
    widths = [1.0] * len(views) + ([0.58] if focus is not None else [])
    # The height that leaves no empty margin around panels of equal scale.
    panel = (WIDTH_IN - 0.3) / sum(widths)
    height = float(np.clip(panel * (limits[1] - limits[0]) / (limits[3] - limits[2]), 6.0, 10.0))
    figure = Figure(figsize=(WIDTH_IN, height + HEAD_IN + FOOT_IN), dpi=110, facecolor="white")
    total = height + HEAD_IN + FOOT_IN
    grid = figure.add_gridspec(
        2, len(widths), width_ratios=widths, left=0.01, right=0.99, top=1 - HEAD_IN / total,
        bottom=FOOT_IN / total, wspace=0.03, hspace=0.1,
    )  # fmt: skip
    for column, (label, view) in enumerate(views):
        axes = figure.add_subplot(grid[:, column])
        draw_view(axes, scene, view, limits, point_area=0.7)
        axes.set_title(f"{label}   {len(view.cloud):,} points", loc="left", fontsize=11, color=INK, pad=6)
        if focus is not None:
            _draw_frame_of(axes, focus)
    for row, (label, view) in enumerate(views if focus is not None else []):
        axes = figure.add_subplot(grid[row, -1])
        draw_view(axes, scene, view, focus or limits, point_area=4.0, rings=False, text_points=10.0)
        axes.set_title(f"{label}, close-up", loc="left", fontsize=11, color=INK, pad=6)
    figure.text(0.012, 1 - 0.18 / total, scene.title, va="top", fontsize=14, fontweight="bold", color=INK)
    figure.legend(
        handles=legend(scene), loc="lower center", ncols=7, frameon=False, fontsize=10, labelcolor=INK,
        bbox_to_anchor=(0.5, 0.002),
    )  # fmt: skip
    return figure


def _draw_clean(scene: ReportScene, limits: Limits) -> Figure:
    total = CLEAN_IN + HEAD_IN + FOOT_IN
    figure = Figure(figsize=(CLEAN_IN + 0.3, total), dpi=110, facecolor="white")
    width = CLEAN_IN / (CLEAN_IN + 0.3)
    axes = figure.add_axes(((1 - width) / 2, FOOT_IN / total, width, CLEAN_IN / total))
    draw_view(axes, scene, scene.before, limits, point_area=0.6)
    figure.text(0.022, 1 - 0.18 / total, scene.title, va="top", fontsize=13, fontweight="bold", color=INK)
    points = f"{len(scene.before.cloud):,} points"
    figure.text(0.022, 1 - 0.5 / total, points, va="top", fontsize=10, color=SOFT)
    figure.legend(
        handles=legend(scene), loc="lower center", ncols=4, frameon=False, fontsize=10, labelcolor=INK,
        bbox_to_anchor=(0.5, 0.002),
    )  # fmt: skip
    return figure


def _square(limits: Limits) -> Limits:
    """The same middle, both sides as long as the longer one."""
    x_min, x_max, y_min, y_max = limits
    half = max(x_max - x_min, y_max - y_min) / 2
    x, y = (x_min + x_max) / 2, (y_min + y_max) / 2
    return x - half, x + half, y - half, y + half


def _focus(scene: ReportScene) -> Limits | None:
    """The surroundings of the lost object that is best seen: of large ones, the nearest."""
    lost = scene.truth.boxes.geometry[scene.lost]
    if not len(lost):
        return None
    is_small = lost[:, 3] * lost[:, 4] < SMALL_M2
    x, y = lost[np.lexsort((np.hypot(lost[:, 0], lost[:, 1]), is_small))[0], :2]
    return x - ZOOM_M / 2, x + ZOOM_M / 2, y - ZOOM_M / 2, y + ZOOM_M / 2


def draw_view(
    axes: Axes,
    scene: ReportScene,
    view: CloudView,
    limits: Limits,
    point_area: float,
    rings: bool = True,
    text_points: float = 7.0,
) -> None:
    """One cloud of a scene with its boxes on these axes; rings: of distance, and thinner lines.

    text_points: size of scores and overlaps.
    """
    prepare_axes(axes, limits)
    if rings:
        draw_rings(axes, limits)
    draw_points(axes, view.cloud, limits, point_area)
    _draw_changes(axes, scene, view, point_area)
    boxes, evaluated = scene.truth.boxes.geometry, scene.truth.is_evaluated
    line = 1.2 if rings else 2.0
    draw_boxes(axes, boxes[~evaluated], TRUTH, line * 0.7, linestyle="dotted", alpha=0.7)
    draw_boxes(axes, boxes[evaluated], TRUTH, line * 1.8)  # wider, so that it shows beside a prediction
    draw_boxes(axes, view.predictions, PREDICTION, line)
    # A lost object is one of the attacked cloud; on a clean bag alone, one that is missed.
    if scene.after is None or view is scene.after:
        for chosen, colour in ((scene.lost, LOST), (scene.displaced, DISPLACED)):
            if chosen is not None:
                draw_boxes(
                    axes, boxes[chosen], colour, line * 1.5, linestyle="dashed", grow_m=0.7, heading=False
                )
        _draw_marks(axes, scene, limits, text_points)


def _draw_marks(axes: Axes, scene: ReportScene, limits: Limits, size: float) -> None:
    """Score and IoU beside each displaced or lost object within the limits; a line leads to one farther off.

    size: of the letters, in points.
    """
    x_min, _, y_min, y_max = limits
    axes.apply_aspect()
    per_pixel = 72 / axes.figure.dpi
    panel = float(axes.bbox.width * per_pixel), float(axes.bbox.height * per_pixel)
    per_m = panel[0] / (y_max - y_min)
    corners = box_corners(scene.truth.boxes.geometry)[:, :4, :2]
    on_paper = np.stack([y_max - corners[..., 1], corners[..., 0] - x_min], axis=2) * per_m
    rectangles = np.concatenate([on_paper.min(axis=1), on_paper.max(axis=1)], axis=1)
    middles = (rectangles[:, :2] + rectangles[:, 2:]) / 2
    shown = [each for each in scene.marks if ((middles[each] > 0) & (middles[each] < panel)).all()]
    grown = rectangles + 0.7 * per_m * np.array([-1, -1, 1, 1])
    sizes = np.array([(LETTER * size * len(scene.marks[each]) + 4, 1.3 * size) for each in shown])
    centres = place_labels(grown[shown], sizes.reshape(-1, 2), rectangles, panel)
    for number, (u, v) in zip(shown, centres, strict=True):
        colour = LOST_TEXT if scene.lost[number] else DISPLACED
        end = np.clip((u, v), grown[number, :2], grown[number, 2:])
        ends = np.array([(u, v), end]) / per_m
        if np.abs(end - (u, v))[1] > size + LEAD or np.abs(end - (u, v))[0] > sizes[0, 0]:
            axes.plot(y_max - ends[:, 0], x_min + ends[:, 1], color=colour, linewidth=0.7, zorder=6)
        axes.text(
            y_max - ends[0, 0], x_min + ends[0, 1], scene.marks[number], fontsize=size, ha="center",
            va="center", zorder=7, color=colour, clip_on=True,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
        )  # fmt: skip


def _draw_changes(axes: Axes, scene: ReportScene, view: CloudView, area: float) -> None:
    """Removed points where they were, added and moved ones where they are."""
    if scene.change is None or scene.after is None:
        return
    removed = xyz(scene.before.cloud[scene.change.removed])
    if view is scene.before:
        axes.scatter(
            removed[:, 1], removed[:, 0], color=REMOVED, s=area * 4.5, linewidths=0, zorder=3, rasterized=True
        )
        return
    axes.scatter(
        removed[:, 1], removed[:, 0], s=area * 5, facecolors="none", edgecolors=REMOVED,
        linewidths=0.35, zorder=3, alpha=0.8, rasterized=True,
    )  # fmt: skip
    for indices, colour in ((scene.change.added, ADDED), (scene.change.moved, MOVED)):
        points = xyz(view.cloud[indices])
        axes.scatter(
            points[:, 1], points[:, 0], color=colour, s=area * 4.5, linewidths=0, zorder=3, rasterized=True
        )


def _draw_frame_of(axes: Axes, limits: Limits) -> None:
    x_min, x_max, y_min, y_max = limits
    axes.plot(
        [y_min, y_max, y_max, y_min, y_min], [x_min, x_min, x_max, x_max, x_min], color=INK, linewidth=0.9,
        zorder=5, scalex=False, scaley=False,
    )  # fmt: skip


def legend(scene: ReportScene) -> list[Line2D]:
    """An entry for each thing in the picture; the longest are last."""

    def dot(colour: str, text: str) -> Line2D:
        return Line2D([], [], linestyle="none", marker="o", markersize=5, color=colour, label=text)

    entries = [
        Line2D([], [], color=TRUTH, linewidth=2, label="truth"),
        Line2D([], [], color=PREDICTION, linewidth=2, label="prediction"),
    ]
    if not scene.truth.is_evaluated.all():
        entries.insert(
            1, Line2D([], [], color=TRUTH, linewidth=1, linestyle="dotted", label="truth, ignored")
        )
    if scene.change:
        for count, colour, label in (
            (len(scene.change.removed), REMOVED, "removed"),
            (len(scene.change.added), ADDED, "added"),
            (len(scene.change.moved), MOVED, "moved"),
        ):
            if count:
                entries.append(dot(colour, f"{count:,} points {label}"))
    if scene.lost.any():
        what = "lost" if scene.after else "missed"
        label = f"{what}: no box with score ≥ {scene.min_score:.2f} at loose overlap"
        entries.append(Line2D([], [], color=LOST, linewidth=2, linestyle="dashed", label=label))
    if scene.displaced is not None and scene.displaced.any():
        label = "displaced: at loose overlap only"
        entries.append(Line2D([], [], color=DISPLACED, linewidth=2, linestyle="dashed", label=label))
    return entries
