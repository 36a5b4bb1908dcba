"""OpenPCDet's form for custom data sets: points/*.npy, labels/*.txt, ImageSets/*.txt."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, one_line
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import se3, wrap_angle
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.import_.drive import DriveFrame, DriveSource, VehicleFrame
from advpipe.stages.import_.folders import (
    cloud_names,
    file_names,
    frame_interval_ns,
    read_split,
    refuse_missing,
    stray_notes,
)
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.options import DROPPED, IGNORED, ImportOptions
from advpipe.stages.import_.point_files import COLUMN_NAMES, cloud_of_columns, parse_columns

_EGO = VehicleTopics()
_VALUES = 8
_LABEL_FIX = "write x y z dx dy dz heading class"


class OpenPcdetForm(DriveForm):
    """Clouds and boxes in the LiDAR's frame; the form knows no cameras, times, poses or ids."""

    title = "OpenPCDet's custom data sets"
    takes = ("split", "interval_s", "lidar_height_m", "columns", "scale_intensity", "classes")
    classes: ClassVar[Mapping[str, str]] = {
        "Car": "car",
        "Vehicle": "car",
        "Truck": "truck",
        "Bus": "truck",
        "Cyclist": "cyclist",
        "Motorcyclist": "cyclist",
        "Pedestrian": "pedestrian",
        "Van": IGNORED,
        "Tram": IGNORED,
        "Misc": IGNORED,
        "Person_sitting": IGNORED,
    }

    def open(self, source: Path, options: ImportOptions) -> DriveSource:
        """Check the folders by the names of their files."""
        if not (source / "points").is_dir():
            raise UsageError(
                f"{source / 'points'} is missing; give a folder with points/*.npy and labels/*.txt"
            )
        return PointFolders(source, options, self.class_map(options))


class PointFolders:
    """The frames of such a folder, in the order of their names or of a split."""

    are_related = False

    def __init__(self, source: Path, options: ImportOptions, classes: Mapping[str, str]) -> None:
        """Raises UsageError for missing files."""
        self._source, self._options, self._classes = source, options, classes
        self.name = source.resolve().name
        self._columns = parse_columns(options.columns) if options.columns else None
        self._interval_ns = frame_interval_ns(options.interval_s)
        self._names = self._checked_names(options.split)

    @property
    def frame_count(self) -> int:
        """The number of chosen clouds."""
        return len(self._names)

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, np.ndarray]]:
        """The LiDAR's mount, if its height was given."""
        height_m = self._options.lidar_height_m
        if height_m is None:
            return ()
        return [(_EGO.base_frame, _EGO.lidar_frame, se3(np.eye(3), [0.0, 0.0, height_m]))]

    @property
    def notes(self) -> Sequence[str]:
        """What was assumed."""
        notes = [f"frames without times, taken as {self._interval_ns / 1e9:g} s apart (--interval)"]
        notes += stray_notes(self._source / "points", ".npy")
        if self._options.lidar_height_m is None:
            notes.append("the height of the LiDAR is unknown (--lidar-height)")
        if not self._is_labelled:
            notes.append("no labels: the frames have no ground truth")
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The frames from the index `first` on."""
        for index, name in enumerate(self._names[first:], first):
            file = self._source / "points" / f"{name}.npy"
            cloud = self._read_points(file)
            vehicle = VehicleFrame({"lidar": cloud})
            if self._is_labelled:
                boxes, ignored = self._read_boxes(self._source / "labels" / f"{name}.txt", name)
                vehicle = VehicleFrame({"lidar": cloud}, boxes, ignored=ignored)
            yield DriveFrame(str(file), (index + 1) * self._interval_ns, {"ego": vehicle}, name)

    def class_names(self) -> Collection[str]:
        """The classes of the chosen frames' labels."""
        files = [self._source / "labels" / f"{name}.txt" for name in self._names if self._is_labelled]
        lines = (line.split() for file in files for line in read_text(file).splitlines())
        return {words[-1] for words in lines if words}

    def _checked_names(self, split: str | None) -> list[str]:
        points = cloud_names(self._source / "points", ".npy")
        labels = file_names(self._source / "labels", ".txt")
        if not points:
            raise UsageError(
                f"{self._source / 'points'} holds no .npy files; save a table of points a frame there"
            )
        self._is_labelled = bool(labels)
        names = points
        if split is not None:
            names = read_split([self._source], split)
            fix = "restore it, or choose another --split"
            refuse_missing(self._source / "points", ".npy", names, points, fix)
        if labels:
            fix = "restore it (empty for a frame without objects), or choose labelled frames by --split"
            refuse_missing(self._source / "labels", ".txt", names, labels, fix)
        if split is None:
            fix = "its label has no cloud: restore it, or choose frames with clouds by --split"
            refuse_missing(self._source / "points", ".npy", labels, points, fix)
        return names

    def _read_points(self, file: Path) -> Cloud:
        try:
            table = np.load(file, allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise AdvpipeError(
                one_line(f"{file}: is no NumPy array, or is truncated ({error}); save it again")
            ) from None
        columns = self._columns or COLUMN_NAMES[:4]
        if getattr(table, "ndim", 0) != 2 or table.shape[1] != len(columns) or table.dtype.kind not in "fiu":
            raise AdvpipeError(
                f"{file}: holds {_described(table)}, not a table of {len(columns)} columns "
                f"({','.join(columns)}); name its columns by --columns"
            )
        scale = self._options.scale_intensity
        return cloud_of_columns(table, columns, 1.0 if scale is None else scale)

    def _read_boxes(self, file: Path, frame: str) -> tuple[Boxes, IgnoredBoxes]:
        rows: list[tuple[list[float], str, str]] = []
        for number, line in enumerate(read_text(file).splitlines(), 1):
            if line.strip():
                box, class_name = self._label_of(line, f"{file}: line {number}")
                if self._classes[class_name] != DROPPED:
                    rows.append((box, class_name, f"{frame}/{number - 1}"))
        counted = [row for row in rows if self._classes[row[1]] != IGNORED]
        ignored = [row for row in rows if self._classes[row[1]] == IGNORED]
        boxes = Boxes(
            _table(counted),
            np.array([CLASSES.index(self._classes[name]) for _, name, _ in counted], np.int64),
            tuple(row[2] for row in counted),
            np.full((len(counted), 3), np.nan),
        )
        return boxes, IgnoredBoxes(
            _table(ignored), tuple(row[1] for row in ignored), tuple(row[2] for row in ignored)
        )

    def _label_of(self, line: str, where: str) -> tuple[list[float], str]:
        *texts, class_name = line.split()
        if len(texts) != _VALUES - 1:
            raise AdvpipeError(f"{where} has {len(texts) + 1} values, not {_VALUES}; {_LABEL_FIX}")
        try:
            box = [float(text) for text in texts]
        except ValueError as error:
            raise AdvpipeError(
                one_line(f"{where} has a value that is no number ({error}); {_LABEL_FIX}")
            ) from None
        if not all(map(math.isfinite, box)):
            raise AdvpipeError(
                one_line(f"{where} has a value that is not finite: {line[:80]!r}; {_LABEL_FIX}")
            )
        if class_name not in self._classes:
            raise AdvpipeError(
                one_line(
                    f"{where}: unknown class {class_name!r}; say what it is: --class {class_name}=car "
                    f"(or another of {', '.join(CLASSES)}, {IGNORED}, {DROPPED})"
                )
            )
        return box, class_name


def _described(loaded: Any) -> str:
    return f"{loaded.shape} of {loaded.dtype}" if isinstance(loaded, np.ndarray) else "several arrays"


def _table(rows: Sequence[tuple[list[float], str, str]]) -> np.ndarray:
    table = np.array([row[0] for row in rows], np.float64).reshape(-1, 7)
    if len(table):
        table[:, 6] = wrap_angle(table[:, 6])
    return table
