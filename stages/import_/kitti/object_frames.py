"""Frames of KITTI's object benchmark: pictures of many drives, with labels in the image of camera 2."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.kitti.calibration import KittiCalibration, read_object_calibration
from advpipe.pipeline.kitti.object_label import DONT_CARE, ObjectLabel, read_object_labels
from advpipe.pipeline.messages.labels import IgnoredBoxes, ImageLabel
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.folders import (
    cloud_names,
    file_names,
    frame_interval_ns,
    read_cloud,
    read_split,
    refuse_missing,
    stray_notes,
)
from advpipe.stages.import_.kitti import cameras
from advpipe.stages.import_.options import DROPPED, IGNORED, ImportOptions

_TEST_SPLITS = ("test", "testing")


class ObjectFrames:
    """The frames of `training` or `testing`, in the order of their names."""

    are_related = False

    def __init__(self, source: Path, options: ImportOptions, classes: Mapping[str, str]) -> None:
        """Checks the folder's files by their names. Raises UsageError."""
        if options.drive is not None:
            raise UsageError("--drive means nothing to KITTI's object frames; leave it out")
        self._folder = _folder_of(source, options.split)
        self._options, self._classes = options, classes
        self._interval_ns = frame_interval_ns(options.interval_s)
        self._names = self._checked_names(source, options.split)
        self.name = f"kitti-{self._folder.name}"
        self._size_px, self._unknown_sizes = self._sizes()
        self.static_transforms = [cameras.lidar_mount(options.lidar_height_m)]

    @property
    def frame_count(self) -> int:
        """The number of chosen clouds."""
        return len(self._names)

    @property
    def notes(self) -> Sequence[str]:
        """What was assumed."""
        ignored = [name for name, ours in self._classes.items() if ours == IGNORED and name != DONT_CARE]
        notes = [
            f"frames of unrelated places, taken as {self._interval_ns / 1e9:g} s apart (--interval)",
            "labels cover camera 2's image outside DontCare; "
            + (f"{', '.join(ignored)} count neither way (--class)" if ignored else "no class is ignored"),
        ]
        if not self._is_labelled:
            notes = [*notes[:1], "no label_2: the frames have no ground truth"]
        notes += stray_notes(self._folder / "velodyne", ".bin")
        if self._unknown_sizes:
            width_px, height_px = cameras.USUAL_SIZE_PX
            notes.append(
                f"{self._unknown_sizes} of {len(self._names)} frames lack a picture in image_2: taken as "
                f"{width_px} x {height_px} pixels"
            )
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The frames from the index `first` on."""
        for index, name in enumerate(self._names[first:], first):
            file = self._folder / "velodyne" / f"{name}.bin"
            yield DriveFrame(str(file), (index + 1) * self._interval_ns, {"ego": self._vehicle(name)}, name)

    def class_names(self) -> Collection[str]:
        """The classes of the chosen frames' labels."""
        files = [self._folder / "label_2" / f"{name}.txt" for name in self._names if self._is_labelled]
        return {each.class_name for file in files for each in read_object_labels(file)}

    def _vehicle(self, name: str) -> VehicleFrame:
        calibration = read_object_calibration(self._folder / "calib" / f"{name}.txt")
        size_px = self._size_px.get(name, cameras.USUAL_SIZE_PX)
        cloud = read_cloud(self._folder / "velodyne" / f"{name}.bin", self._options.scale_intensity)
        mounts = cameras.camera_mounts(calibration)
        if not self._is_labelled:
            views = cameras.camera_views(calibration, size_px)
            return VehicleFrame({"lidar": cloud}, cameras=views, transforms=mounts)
        file = self._folder / "label_2" / f"{name}.txt"
        objects = known_objects(read_object_labels(file), self._classes, file)
        boxes, ignored = split_objects(objects, self._classes, calibration, name)
        regions = [each for each in objects if not each.has_box]
        return VehicleFrame(
            {"lidar": cloud},
            boxes,
            ignored=ignored,
            coverage=cameras.label_coverage(calibration, size_px, regions),
            cameras=cameras.camera_views(calibration, size_px, image_labels(objects, name)),
            transforms=mounts,
        )

    def _checked_names(self, source: Path, split: str | None) -> list[str]:
        folder = self._folder
        clouds = cloud_names(folder / "velodyne", ".bin")
        if not clouds:
            raise UsageError(
                f"{folder / 'velodyne'} holds no .bin files; unpack KITTI's velodyne archive there"
            )
        names = clouds
        if split is not None and (split not in _TEST_SPLITS or _has_split(folder, split)):
            names = read_split([source, folder, folder.parent], split)
            refuse_missing(
                folder / "velodyne", ".bin", names, clouds, "restore it, or choose another --split"
            )
        refuse_missing(
            folder / "calib", ".txt", names, file_names(folder / "calib", ".txt"),
            "restore it from KITTI's calibration archive",
        )  # fmt: skip
        labels = file_names(folder / "label_2", ".txt")
        self._is_labelled = bool(labels)
        if labels:
            fix = "restore it, or choose labelled frames by --split"
            refuse_missing(folder / "label_2", ".txt", names, labels, fix)
        if split is None:
            fix = "its label has no cloud: restore it, or choose frames with clouds by --split"
            refuse_missing(folder / "velodyne", ".bin", labels, clouds, fix)
        return names

    def _sizes(self) -> tuple[Mapping[str, tuple[int, int]], int]:
        """The sizes of the pictures that are there, and how many are not."""
        files = {name: self._folder / "image_2" / f"{name}.png" for name in self._names}
        sizes = {name: size for name, file in files.items() if (size := cameras.picture_size(file))}
        return sizes, len(files) - len(sizes)


def known_objects(
    objects: Sequence[ObjectLabel], classes: Mapping[str, str], file: Path
) -> list[ObjectLabel]:
    """The objects but those to be dropped. Raises AdvpipeError for an unknown class and a missing box."""
    kept = []
    for each in objects:
        if each.class_name not in classes:
            raise AdvpipeError(
                f"{file}: unknown class {each.class_name!r}; say what it is: --class {each.class_name}=car "
                f"(or another of {', '.join(CLASSES)}, {IGNORED}, {DROPPED})"
            )
        ours = classes[each.class_name]
        if ours in CLASSES and not each.has_box:
            raise AdvpipeError(
                f"{file}: a {each.class_name} has no 3D box; restore the file, or count it neither way by "
                f"--class {each.class_name}={IGNORED}"
            )
        if ours != DROPPED:
            kept.append(each)
    return kept


def split_objects(
    objects: Sequence[ObjectLabel], classes: Mapping[str, str], calibration: KittiCalibration, frame: str
) -> tuple[Boxes, IgnoredBoxes]:
    """The 3D boxes in the LiDAR's frame that count, and those that do not."""
    counted = [k for k, each in enumerate(objects) if each.has_box and classes[each.class_name] != IGNORED]
    ignored = [k for k, each in enumerate(objects) if each.has_box and classes[each.class_name] == IGNORED]

    def geometry(chosen: list[int]) -> Float64:
        return np.array([objects[k].lidar_box(calibration) for k in chosen], np.float64).reshape(-1, 7)

    return (
        Boxes(
            geometry(counted),
            np.array([CLASSES.index(classes[objects[k].class_name]) for k in counted], np.int64),
            tuple(object_id(frame, k) for k in counted),
            np.full((len(counted), 3), np.nan),
        ),
        IgnoredBoxes(
            geometry(ignored),
            tuple(objects[k].class_name for k in ignored),
            tuple(object_id(frame, k) for k in ignored),
        ),
    )


def image_labels(objects: Sequence[ObjectLabel], frame: str) -> tuple[ImageLabel, ...]:
    """What camera 2's image shows, in the order of the file; an object without a 3D box has no id."""
    return tuple(
        ImageLabel(
            object_id(frame, k) if each.has_box else "",
            each.class_name,
            each.edges_px,
            each.truncation,
            each.occlusion,
            each.alpha_rad,
        )
        for k, each in enumerate(objects)
    )


def object_id(frame: str, number: int) -> str:
    """The name of the object on a line of a frame's file; the benchmark knows no object in two frames."""
    return f"{frame}/{number}"


def _has_split(folder: Path, split: str) -> bool:
    return any((each / "ImageSets" / f"{split}.txt").is_file() for each in (folder, folder.parent))


def _folder_of(source: Path, split: str | None) -> Path:
    """The folder with velodyne/ and calib/: the source, or its training/ or testing/."""
    if any((source / name).is_dir() for name in ("velodyne", "label_2")):
        return source
    name = "testing" if split in _TEST_SPLITS or not (source / "training").is_dir() else "training"
    folder = source / name
    if not (folder / "velodyne").is_dir():
        raise UsageError(f"{folder / 'velodyne'} is missing; unpack KITTI's velodyne archive there")
    return folder
