"""Frames of bags as plain arrays on disk: decoded once, then read by position."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import repeat
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.partial import PartialFolder
from advpipe.pipeline.geometry.boxes import Boxes, no_boxes, points_in_boxes
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.messages.cloud import Cloud, xyzi
from advpipe.stages.train.stored_uncounted import StoredUncounted, store_uncounted

_UNCOUNTED = "uncounted.npz"

Points = npt.NDArray[np.float32]


def transformed(points: Points, new_SE3_old: Float64) -> Points:
    """Points (N, 4) whose x, y, z a matrix (4, 4) maps, as a new array.

    Column by column: a matrix product with so small a matrix is slower, and wakes all threads of the BLAS.
    """
    matrix = new_SE3_old.astype(np.float32)
    x, y, z, new = points[:, 0], points[:, 1], points[:, 2], np.empty_like(points)
    for column, (a, b, c, shift) in enumerate(matrix[:3]):
        new[:, column] = a * x + b * y + c * z + shift
    new[:, 3] = points[:, 3]
    return new


class LabelledCloud(Protocol):
    """A cloud and its ground truth in the cloud's frame, as `pipeline.bag.frames.Frame`."""

    @property
    def cloud(self) -> Cloud: ...

    @property
    def boxes(self) -> Boxes: ...

    @property
    def uncounted(self) -> Uncounted: ...


@dataclass(frozen=True)
class CroppedFrame:
    """What is stored of a frame. points: (N, 4), finite. inside: for each box, the rows of its points."""

    points: Points
    boxes: Boxes
    inside: tuple[npt.NDArray[np.int64], ...]
    uncounted: Uncounted


def cropped(frame: LabelledCloud, radius_m: float) -> CroppedFrame:
    """A frame within a radius around the sensor."""
    points = xyzi(frame.cloud)
    near = np.hypot(points[:, 0], points[:, 1]) < radius_m
    points = points[near & np.isfinite(points).all(1)]
    inside = tuple(points_in_boxes(points, frame.boxes.geometry))
    return CroppedFrame(points, frame.boxes, inside, frame.uncounted)


@dataclass(frozen=True)
class TrainingFrame:
    """points: (N, 4) x, y, z, intensity. boxes: (M, 7). labels: (M,). counts: (M,) points inside.

    ignored: (I, 7), objects that count neither way. coverage: where objects are labelled. sensor: number of
    the kind of LiDAR.
    """

    points: Points
    boxes: npt.NDArray[np.float64]
    labels: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int64]
    ignored: npt.NDArray[np.float64] = field(default_factory=no_boxes)
    coverage: LabelCoverage = field(default_factory=LabelCoverage)
    sensor: int = 0


class StoredMount(NamedTuple):
    """How the LiDAR of a stored frame stands: how far its cloud is raised for training, so that all clouds
    are seen from one height, and a number for its kind, such as its rings."""

    raised_m: float = 0.0
    sensor: int = 0


@dataclass(frozen=True)
class FrameStore:
    """A folder of frames.

    points.bin: all points, 4 x float32; objects.bin: the points inside each box, box after box;
    index.npz: where each frame and box begins, and the boxes; uncounted.npz: see `stored_uncounted`.
    """

    folder: Path

    @classmethod
    def build(
        cls,
        frames: Iterable[CroppedFrame],
        folder: Path,
        key: object,
        mounts: Iterable[StoredMount] = repeat(StoredMount()),
    ) -> FrameStore:
        """Store frames, each with its mount, unless `folder` already holds those of `key`."""
        key_text = json.dumps(key, sort_keys=True)
        key_file = folder / "key.json"
        if key_file.is_file() and key_file.read_text() == key_text:
            return cls(folder)
        partial = PartialFolder(folder)
        try:
            _store(zip(frames, mounts, strict=False), partial.path)
            (partial.path / "key.json").write_text(key_text)
            partial.commit(may_replace=lambda _: True)
        except BaseException:
            partial.discard()
            raise
        return cls(folder)

    @cached_property
    def _index(self) -> dict[str, npt.NDArray[np.int64]]:
        with np.load(self.folder / "index.npz") as arrays:
            index = dict(arrays)
        index["objects"] = np.concatenate([[0], np.cumsum(index["counts"])])
        return index

    @cached_property
    def _uncounted(self) -> StoredUncounted:
        return StoredUncounted.read(self.folder / _UNCOUNTED)

    def __len__(self) -> int:
        return len(self._index["frame_points"]) - 1

    @property
    def labels(self) -> npt.NDArray[np.int64]:
        """Class of every box of every frame."""
        return self._index["labels"]

    @property
    def counts(self) -> npt.NDArray[np.int64]:
        """Points inside every box of every frame."""
        return self._index["counts"]

    @cached_property
    def sensors(self) -> npt.NDArray[np.int64]:
        """The kind of LiDAR, a number, of every box of every frame."""
        return self._of_boxes("frame_sensors")

    @cached_property
    def _raised_m(self) -> npt.NDArray[np.float64]:
        return self._of_boxes("frame_raised_m").astype(np.float64)

    def _of_boxes(self, of_frames: str) -> npt.NDArray[np.int64]:
        return np.repeat(self._index[of_frames], np.diff(self._index["frame_boxes"]))

    def frame(self, i: int) -> TrainingFrame:
        """Frame i, as new arrays, from the height of all frames."""
        first, last = self._index["frame_boxes"][i : i + 2]
        raised_m = float(self._index["frame_raised_m"][i])
        points = self._read("points.bin", *self._index["frame_points"][i : i + 2])
        boxes = self._index["boxes"][first:last].astype(np.float64)
        ignored, coverage = self._uncounted.of(i)
        for rows in (points, boxes, ignored):
            rows[:, 2] += raised_m
        return TrainingFrame(
            points,
            boxes,
            self.labels[first:last],
            self.counts[first:last],
            ignored,
            coverage.transformed(se3(np.eye(3), (0.0, 0.0, raised_m))),
            int(self._index["frame_sensors"][i]),
        )

    def object(self, i: int) -> tuple[Points, npt.NDArray[np.float64]]:
        """Points (n, 4) and box (7,) of object i among all boxes of all frames."""
        points = self._read("objects.bin", *self._index["objects"][i : i + 2])
        box = self._index["boxes"][i].astype(np.float64)
        points[:, 2] += np.float32(self._raised_m[i])
        box[2] += self._raised_m[i]
        return points, box

    def _read(self, name: str, first: int, last: int) -> Points:
        count = 4 * int(last - first)
        return np.fromfile(self.folder / name, np.float32, count, offset=16 * int(first)).reshape(-1, 4)


def _store(frames: Iterable[tuple[CroppedFrame, StoredMount]], folder: Path) -> None:
    """Write the files of a `FrameStore` into an empty folder."""
    boxes, labels, counts, frame_points, frame_boxes = [], [], [], [0], [0]
    uncounted, stored_mounts = [], []
    with (
        (folder / "points.bin").open("wb") as points_file,
        (folder / "objects.bin").open("wb") as objects,
    ):
        for frame, mount in frames:
            points_file.write(frame.points.tobytes())
            for rows in frame.inside:
                objects.write(frame.points[rows].tobytes())
            boxes.append(frame.boxes.geometry)
            labels.append(frame.boxes.labels)
            counts += [len(rows) for rows in frame.inside]
            frame_points.append(frame_points[-1] + len(frame.points))
            frame_boxes.append(frame_boxes[-1] + len(frame.boxes))
            uncounted.append(frame.uncounted)
            stored_mounts.append(mount)
    if not boxes or not frame_points[-1]:
        raise AdvpipeError("the bags contain no labelled clouds to train on")
    store_uncounted(uncounted, folder / _UNCOUNTED)
    np.savez(
        folder / "index.npz",
        boxes=np.concatenate(boxes),
        labels=np.concatenate(labels),
        counts=np.array(counts, dtype=np.int64),
        frame_points=frame_points,
        frame_boxes=frame_boxes,
        frame_raised_m=[mount.raised_m for mount in stored_mounts],
        frame_sensors=[mount.sensor for mount in stored_mounts],
    )
