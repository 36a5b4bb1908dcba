"""The frames of `attack_study.py`: of a bag, or of one file that a machine without bags can read."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from attacked_clouds import spread_frames

from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud

SUFFIX = ".npz"


def read_bag(bag: Path, count: int, chosen: str | None = None) -> list[Frame]:
    """So many frames of a bag, evenly spread; or those chosen as start:stop:step."""
    found = resolve_bag(bag)
    return list(read_frames(found, FrameSlice.parse(chosen) if chosen else spread_frames(found, count)))


def store(frames: Sequence[Frame], path: Path) -> None:
    """Write frames into one compressed file. Raises UsageError where something in them counts neither way."""
    if any(frame.uncounted for frame in frames):
        raise UsageError("the drive has objects that do not count, which this file cannot hold; use the bag")
    points = np.concatenate([frame.cloud for frame in frames])
    boxes = [frame.boxes for frame in frames]
    np.savez_compressed(
        path,
        index=[frame.index for frame in frames],
        stamp_ns=[frame.stamp_ns for frame in frames],
        points=[len(frame.cloud) for frame in frames],
        objects=[len(each) for each in boxes],
        geometry=np.concatenate([each.geometry for each in boxes]),
        labels=np.concatenate([each.labels for each in boxes]),
        ids=np.array([name for each in boxes for name in each.ids], dtype=str),
        velocity_mps=np.concatenate([each.velocity_mps for each in boxes]),
        **{f"point_{name}": _planes(points[name]) for name in POINT_DTYPE.names or ()},
    )


def load(path: Path) -> list[Frame]:
    """The frames of a file of `store`."""
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    points = np.zeros(int(arrays["points"].sum()), POINT_DTYPE)
    for name in POINT_DTYPE.names or ():
        whole_words = np.ascontiguousarray(arrays[f"point_{name}"].T)
        points[name] = whole_words.view(POINT_DTYPE[name]).ravel()
    clouds: list[Cloud] = np.split(points, np.cumsum(arrays["points"])[:-1])
    whole = Boxes(arrays["geometry"], arrays["labels"], tuple(arrays["ids"].tolist()), arrays["velocity_mps"])
    parts = np.split(np.arange(len(whole)), np.cumsum(arrays["objects"])[:-1])
    return [
        Frame(int(index), int(stamp_ns), cloud, whole[part])
        for index, stamp_ns, cloud, part in zip(
            arrays["index"], arrays["stamp_ns"], clouds, parts, strict=True
        )
    ]


def opened(drive: Path, count: int) -> list[Frame]:
    """The frames of a stored file, at most so many, or of a bag."""
    if drive.suffix == SUFFIX:
        frames = load(drive)
        return [
            frames[i] for i in np.linspace(0, len(frames) - 1, min(count, len(frames))).round().astype(int)
        ]
    return read_bag(drive, count)


def identity(frames: Sequence[Frame]) -> str:
    """A checksum of the frames' points."""
    digest = hashlib.sha256()
    for frame in frames:
        digest.update(frame.cloud.tobytes())
    return digest.hexdigest()


def _planes(values: npt.NDArray[np.generic]) -> npt.NDArray[np.uint8]:
    """The bytes of numbers (N,), those of one significance together, (B, N): they compress better so."""
    planes: npt.NDArray[np.uint8] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1).T
    return np.ascontiguousarray(planes)
