"""The pictures of bags as plain arrays on disk: decoded once, then read by position."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_pictures import (
    RecordedCamera,
    read_labels,
    read_pictures,
    read_visible_shares,
    recorded_cameras,
)
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.partial import PartialFolder
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.image_detector.scoring import OTHER, PictureTruth
from advpipe.pipeline.image_detector.targets import PictureObjects

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class LabelledPicture:
    """A picture (H, W, 3), and its objects; visible: (M,) the share that nothing hides, NaN where unknown."""

    rgb: Image
    truth: PictureTruth
    visible: npt.NDArray[np.float64]


def labelled_cameras(bag: Path) -> list[RecordedCamera]:
    """The cameras to learn from. Raises UsageError for a bag without labelled pictures."""
    found = recorded_cameras(BagReader(bag))
    if not found:
        raise UsageError(
            f"{bag} holds no camera with labelled pictures; simulate a drive with sensors.cameras"
        )
    return found


def labelled_pictures(bag: Path) -> Iterator[LabelledPicture]:
    """The pictures of all cameras, one camera after the other, that labels belong to."""
    reader = BagReader(bag)
    for camera in labelled_cameras(bag):
        labels, shares = read_labels(reader, camera), read_visible_shares(reader, camera)
        for picture in read_pictures(reader, camera):
            if picture.stamp_ns not in labels:
                continue
            mine, known = labels[picture.stamp_ns], shares.get(picture.stamp_ns, {})
            visible = np.array([known.get(each.id, np.nan) for each in mine], np.float64)
            where = f"{bag}: {camera.image_topic}"
            yield LabelledPicture(picture.rgb(where), PictureTruth.of(mine), visible)


@dataclass(frozen=True)
class PictureStore:
    """A folder of pictures. pixels.bin: one after the other; index.npz: their sizes, and all objects."""

    folder: Path

    @classmethod
    def build(cls, bags: Mapping[Path, str], folder: Path) -> PictureStore:
        """Store the pictures of the bags, with their checksums, unless `folder` already holds these."""
        key = json.dumps(list(bags.values()))
        key_file = folder / "key.json"
        if not key_file.is_file() or key_file.read_text() != key:
            partial = PartialFolder(folder)
            try:
                _store(
                    (each for bag in track(list(bags), "read pictures") for each in labelled_pictures(bag)),
                    partial.path,
                )
                (partial.path / "key.json").write_text(key)
                partial.commit(may_replace=lambda _: True)
            except BaseException:
                partial.discard()
                raise
        return cls(folder)

    def __len__(self) -> int:
        return len(self._index["sizes"])

    def __getitem__(self, number: int) -> LabelledPicture:
        index = self._index
        height, width = index["sizes"][number].tolist()
        start = int(self._begins[number])
        rgb = self._pixels[start : start + height * width * 3].reshape(height, width, 3)
        mine = slice(*self._objects[number : number + 2].tolist())
        truth = PictureTruth(
            index["boxes"][mine], index["labels"][mine], index["occlusion"][mine], index["truncation"][mine]
        )
        return LabelledPicture(rgb, truth, index["visible"][mine])

    @cached_property
    def class_counts(self) -> npt.NDArray[np.int64]:
        """How many objects of each of our classes are in the pictures."""
        labels = self._index["labels"]
        return np.bincount(labels[labels != OTHER], minlength=4)

    @cached_property
    def _index(self) -> dict[str, npt.NDArray[Any]]:
        with np.load(self.folder / "index.npz") as arrays:
            return dict(arrays)

    @cached_property
    def _pixels(self) -> npt.NDArray[np.uint8]:
        return np.memmap(self.folder / "pixels.bin", np.uint8, "r")

    @cached_property
    def _begins(self) -> npt.NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(self._index["sizes"].prod(axis=1) * 3)])

    @cached_property
    def _objects(self) -> npt.NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(self._index["counts"])])


def learned_objects(picture: LabelledPicture, least_height_px: float, least_share: float) -> PictureObjects:
    """The objects of a picture that is in part visible; where shares are unknown, KITTI's levels count."""
    truth = picture.truth
    shows = truth.occlusion < 3
    enough = np.where(np.isnan(picture.visible), truth.occlusion < 2, picture.visible >= least_share)
    high = truth.boxes_px[:, 3] - truth.boxes_px[:, 1] + 1 >= least_height_px
    kept = shows & (truth.labels != OTHER)
    return PictureObjects(truth.boxes_px[kept].astype(np.float32), truth.labels[kept], (enough & high)[kept])


def _store(pictures: Iterable[LabelledPicture], folder: Path) -> None:
    sizes, truths, visible = [], [], []
    with (folder / "pixels.bin").open("wb") as file:
        for picture in pictures:
            file.write(np.ascontiguousarray(picture.rgb).tobytes())
            sizes.append(picture.rgb.shape[:2])
            truths.append(picture.truth)
            visible.append(picture.visible)
    if not sizes:
        raise UsageError("the bags hold no labelled picture to learn from")
    np.savez(
        folder / "index.npz",
        sizes=np.array(sizes, np.int64),
        counts=np.array([len(each.labels) for each in truths], np.int64),
        boxes=np.concatenate([each.boxes_px for each in truths]),
        labels=np.concatenate([each.labels for each in truths]),
        occlusion=np.concatenate([each.occlusion for each in truths]),
        truncation=np.concatenate([each.truncation for each in truths]),
        visible=np.concatenate(visible),
    )
