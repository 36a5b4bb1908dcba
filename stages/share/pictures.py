"""Pictures of a data set for its card: a frame from the middle, clean and after each attack on clouds."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.birds_eye import (
    ADDED,
    INK,
    REMOVED,
    TRUTH,
    draw_boxes,
    draw_points,
    draw_rings,
    prepare_axes,
)
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.messages.cloud import Cloud, xyz

REACH_M = 45.0
SIDE_IN, HEAD_IN = 6.2, 0.4
_POINTS = 9.0  # size of the points that an attack removed or added


class SharedPicture(NamedTuple):
    """A PNG under `figures/` and what it shows, in a sentence."""

    file_name: str
    caption: str


def draw_clean(bag: Path, lidar_topic: str, folder: Path) -> SharedPicture:
    """The middle frame of a clean bag into `folder/clean.png`."""
    frame = _middle_frame(bag, lidar_topic)
    figure = Figure(figsize=(SIDE_IN, SIDE_IN + HEAD_IN), dpi=110, facecolor="white")
    _draw(figure, 0, 1, frame, frame.cloud, f"frame {frame.index}: {len(frame.cloud):,} points")
    _save(figure, folder / "clean.png")
    boxes = "; true boxes in blue" if len(frame.boxes.geometry) else ""
    return SharedPicture("clean.png", f"Frame {frame.index} of {lidar_topic} from above{boxes}.")


def draw_attack(clean: Path, bag: Path, lidar_topic: str, folder: Path) -> SharedPicture | None:
    """The middle frame of an adversarial bag beside the clean one; None if the clouds do not differ."""
    adversarial = _middle_frame(bag, lidar_topic)
    times_ns = BagReader(clean).log_times_ns(lidar_topic)
    index = int(np.searchsorted(times_ns, BagReader(bag).log_times_ns(lidar_topic)[adversarial.index]))
    before = next(iter(read_frames(clean, FrameSlice(index, index + 1), lidar_topic=lidar_topic)), None)
    if before is None or before.stamp_ns != adversarial.stamp_ns:
        return None
    gone, new = _only_in(before.cloud, adversarial.cloud), _only_in(adversarial.cloud, before.cloud)
    if not len(gone) and not len(new):
        return None
    figure = Figure(figsize=(2 * SIDE_IN, SIDE_IN + HEAD_IN), dpi=110, facecolor="white")
    _draw(figure, 0, 2, before, before.cloud, f"clean: {len(before.cloud):,} points", gone, REMOVED)
    title = f"{bag.name}: {len(adversarial.cloud):,} points"
    _draw(figure, 1, 2, before, adversarial.cloud, title, new, ADDED)
    _save(figure, folder / f"{bag.name}.png")
    return SharedPicture(
        f"{bag.name}.png",
        f"Frame {before.index} before and after {bag.name}: {len(gone):,} points that are gone or changed in "
        f"orange, {len(new):,} new or changed ones in magenta.",
    )


def _middle_frame(bag: Path, lidar_topic: str) -> Frame:
    middle = BagReader(bag).topics[lidar_topic].count // 2
    return next(iter(read_frames(bag, FrameSlice(middle, middle + 1), lidar_topic=lidar_topic)))


def _only_in(cloud: Cloud, other: Cloud) -> Cloud:
    """The points of a cloud that do not occur, byte for byte, in the other."""
    return cloud[~np.isin(_as_bytes(cloud), _as_bytes(other))]


def _as_bytes(cloud: Cloud) -> npt.NDArray[np.bytes_]:
    # numpy sorts byte strings but not voids; it strips trailing zeros, so each string gets a final 1.
    rows = np.ascontiguousarray(cloud).view(np.uint8).reshape(len(cloud), cloud.dtype.itemsize)
    marked = np.concatenate([rows, np.ones((len(cloud), 1), np.uint8)], axis=1)
    return marked.view(f"S{marked.shape[1]}").ravel()


def _draw(
    figure: Figure,
    column: int,
    columns: int,
    truth: Frame,
    cloud: Cloud,
    title: str,
    marked: Cloud | None = None,
    colour: str = INK,
) -> None:
    share = SIDE_IN / (SIDE_IN + HEAD_IN)
    axes = figure.add_axes((column / columns + 0.01 / columns, 0.01, 0.98 / columns, share - 0.015))
    limits = (-REACH_M, REACH_M, -REACH_M, REACH_M)
    prepare_axes(axes, limits)
    draw_rings(axes, limits)
    draw_points(axes, cloud, limits, area=0.8)
    if marked is not None and len(marked):
        points = xyz(marked)
        axes.scatter(points[:, 1], points[:, 0], color=colour, s=_POINTS, linewidths=0, zorder=3)
    draw_boxes(axes, truth.boxes.geometry, TRUTH, 1.4)
    axes.set_xlim(REACH_M, -REACH_M)
    axes.set_ylim(-REACH_M, REACH_M)
    axes.set_title(title, loc="left", fontsize=11, color=INK, pad=6)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, metadata={"Software": None})
