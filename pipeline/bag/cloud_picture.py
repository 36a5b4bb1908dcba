"""One LiDAR cloud in bird's-eye view as a picture, alone or with what an attack changed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from advpipe.pipeline.bag.frames import Frame, FrameSlice, find_lidar_topic, has_ground_truth, read_frames
from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
from advpipe.pipeline.bag.locate import CLEAN_NAME, resolve_bag
from advpipe.pipeline.bag.reader import BagReader
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
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.core.picture_file import refuse_picture, save_picture
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import cloud_difference

SIDE_IN, HEAD_IN, FOOT_IN, MARGIN_IN = 8.0, 0.85, 0.7, 0.15
NEAREST_REACH_M, FARTHEST_REACH_M = 20.0, 100.0
MOST_VECTORS = 5_000
"""More touched points are pixels also in PDF and SVG, which would be slow to open."""


@dataclass(frozen=True)
class _Touched:
    """Points that an attack touched in one way; marker: each way has its own, as colours are not all that
    tells them apart."""

    points: Cloud
    action: str
    colour: str
    marker: str
    is_hollow: bool = False


def draw_cloud(
    bag: Path,
    index: int,
    out: Path,
    *,
    attacked: Path | None = None,
    lidar_topic: str | None = None,
    overwrite: bool = False,
) -> None:
    """Draws the cloud of this index, with the true boxes if there are any, into a file.

    attacked: an adversarial version of the bag, whose cloud is drawn instead, with the points that differ.
    An adversarial bag in a data set is compared with the data set's clean bag. Raises AdvpipeError for an
    index out of range, a bag that lacks the frame, a file that exists, and one that is not a picture.
    """
    refuse_picture(out, overwrite)
    path = resolve_bag(bag)
    reader = BagReader(path)
    notice_default_lidar(reader, lidar_topic)
    topic = find_lidar_topic(reader, lidar_topic)
    frame = _frame(path, index, topic)
    before, after, name = frame, None, path.parent.name if path.name == CLEAN_NAME else _name(path)
    if attacked is not None:
        other = resolve_bag(attacked)
        after, name = _same_frame(other, reader, index, topic), _name(other)
    elif reader.provenance.is_attack and (clean := path.parent / CLEAN_NAME).is_dir() and path != clean:
        before, after = _same_frame(resolve_bag(clean), reader, index, topic), frame
    title = f"{name}, frame {index} of {topic}"
    save_picture(_figure(title, before, after, has_ground_truth(path, topic)), out)


def _frame(bag: Path, index: int, topic: str) -> Frame:
    """Raises UsageError, with the valid range, for an index that the bag does not have."""
    count = BagReader(bag).topics[topic].count
    if not 0 <= index < count:
        valid = f"choose from 0 to {count - 1}" if count else "it holds no clouds"
        raise UsageError(f"{bag} has no frame {index} of {topic}; {valid}")
    return next(iter(read_frames(bag, FrameSlice(index, index + 1), lidar_topic=topic)))


def _name(bag: Path) -> str:
    """A bag's name; that of a folder may have dots in it, such as `detach-0.01`."""
    return bag.stem if bag.suffix == ".mcap" else bag.name


def _same_frame(bag: Path, reader: BagReader, index: int, topic: str) -> Frame:
    """The frame of `bag` that was logged with the frame of this index of the bag in `reader`."""
    topic = find_lidar_topic(other := BagReader(bag), topic)
    time_ns = reader.log_times_ns(topic)[index]
    times_ns = other.log_times_ns(topic)
    (found,) = np.nonzero(times_ns == time_ns)
    if not len(found):
        (common,) = np.nonzero(np.isin(reader.log_times_ns(topic), times_ns))
        listed = ", ".join(map(str, common[:20])) + (", ..." if len(common) > 20 else "")
        both = f"both have the frames {listed}" if len(common) else "they have no frame in common"
        raise UsageError(f"{bag} lacks frame {index} of {reader.path}; {both}")
    return _frame(bag, int(found[0]), topic)


def _figure(title: str, before: Frame, after: Frame | None, has_truth: bool) -> Figure:
    width, height = SIDE_IN + 2 * MARGIN_IN, SIDE_IN + HEAD_IN + FOOT_IN
    figure = Figure(figsize=(width, height), facecolor="white")
    axes = figure.add_axes((MARGIN_IN / width, FOOT_IN / height, SIDE_IN / width, SIDE_IN / height))
    shown = after or before
    cloud = _finite(shown.cloud)
    boxes = before.boxes.geometry[np.isfinite(before.boxes.geometry).all(axis=1)]
    limits = _limits(cloud)
    prepare_axes(axes, limits)
    draw_rings(axes, limits)
    draw_points(axes, cloud, limits, area=1.0)
    draw_boxes(axes, boxes, TRUTH, 1.6)
    touched = [] if after is None else _touched(before.cloud, after.cloud)
    entries = [_draw_touched(axes, each) for each in touched]
    _draw_scale_bar(axes, limits)
    axes.set_xlim(limits[3], limits[2])
    axes.set_ylim(limits[0], limits[1])
    if has_truth:
        label = f"{len(boxes)} true box" + ("" if len(boxes) == 1 else "es")
        entries.insert(0, Line2D([], [], color=TRUTH, linewidth=2, label=label))
    if after is not None and not touched:
        entries.append(Line2D([], [], linestyle="none", label="no point differs from the clean cloud"))
    figure.text(MARGIN_IN / width, 1 - 0.16 / height, title, va="top", fontsize=13, weight="bold", color=INK)
    about = f"{len(shown.cloud):,} points; forward is up, higher points are darker, rings every 20 m"
    figure.text(MARGIN_IN / width, 1 - 0.5 / height, about, va="top", fontsize=10, color=SOFT)
    if entries:
        figure.legend(
            handles=entries, loc="lower center", ncols=4, frameon=False, fontsize=10, labelcolor=INK,
            bbox_to_anchor=(0.5, 0.08 / height),
        )  # fmt: skip
    return figure


def _finite(cloud: Cloud) -> Cloud:
    return cloud[np.isfinite(xyz(cloud)).all(axis=1)]


def _limits(cloud: Cloud) -> Limits:
    """A square around the sensor with nearly all points (N,), in whole 10 m."""
    points = xyz(cloud)
    farthest_m = np.quantile(np.abs(points[:, :2]).max(axis=1), 0.98) if len(points) else 0.0
    reach_m = float(np.clip(10 * np.ceil(farthest_m / 10), NEAREST_REACH_M, FARTHEST_REACH_M))
    return -reach_m, reach_m, -reach_m, reach_m


def _touched(clean: Cloud, adversarial: Cloud) -> list[_Touched]:
    """What was done to the points of a cloud: removed ones where they were, others where they are."""
    change = cloud_difference(clean, adversarial)
    reflecting = np.setdiff1d(change.intensity_changed, change.moved)
    ways = (
        _Touched(clean[change.removed], "removed", REMOVED, "o", is_hollow=True),
        _Touched(adversarial[change.added], "added", ADDED, "P"),
        _Touched(adversarial[change.moved], "moved", MOVED, "D"),
        _Touched(adversarial[reflecting], "with another intensity", MOVED, "s", is_hollow=True),
    )
    return [each for each in ways if len(each.points)]


def _draw_touched(axes: Axes, touched: _Touched) -> Line2D:
    """Draws the points; the entry of the legend for them."""
    points, fill = xyz(_finite(touched.points)), "none" if touched.is_hollow else touched.colour
    axes.scatter(
        points[:, 1], points[:, 0], s=9.0, marker=touched.marker, facecolors=fill, edgecolors=touched.colour,
        linewidths=0.6 if touched.is_hollow else 0.0, rasterized=len(points) > MOST_VECTORS, zorder=3,
    )  # fmt: skip
    count = len(touched.points)
    return Line2D(
        [], [], linestyle="none", marker=touched.marker, markersize=6, markerfacecolor=fill,
        markeredgecolor=touched.colour, label=f"{count:,} point{'' if count == 1 else 's'} {touched.action}",
    )  # fmt: skip


def _draw_scale_bar(axes: Axes, limits: Limits) -> None:
    """A bar in the lower right corner with its length in metres."""
    x_min, x_max, y_min, _ = limits
    length_m = 10 if x_max <= 40 else 20
    x, right = x_min + 0.03 * (x_max - x_min), y_min + 0.03 * (x_max - x_min)
    tick = 0.008 * (x_max - x_min)
    bar = [(right, x + tick), (right, x), (right + length_m, x), (right + length_m, x + tick)]
    axes.plot(*zip(*bar, strict=True), color=INK, linewidth=1.8, zorder=7)
    axes.text(
        right + length_m / 2, x + tick, f"{length_m} m", fontsize=9, color=INK, ha="center", va="bottom",
        zorder=7,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
    )  # fmt: skip
