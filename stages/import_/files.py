"""The form `files`: a folder with a file a cloud, and perhaps times, poses and boxes beside them."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, invert, se3_from_yaw
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.named_boxes import USUAL_CLASSES, sort_named_boxes
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.point_files import POINT_READERS, parse_columns, read_point_file
from advpipe.stages.import_.text_tables import read_boxes, read_poses, read_times, time_ns

LABELS, POSES, TIMES = "labels", "poses.txt", ("times.txt", "timestamps.txt")
DEFAULT_INTERVAL_S = 0.1
_FARTHEST_POSE_NS = 100_000_000
"""Between a cloud and the pose that is taken for it."""

_STAMP = re.compile(r"\d{19}|\d{16}|\d{13}|\d{10}\.\d{1,9}|(\d{10})_(\d{9})|\d{10}")


class PointFolderForm(DriveForm):
    """A folder of .pcd, .ply, .npy or .bin files in the natural order of their names."""

    title = "a folder of point cloud files (.pcd, .ply, .npy, .bin)"
    takes = ("interval_s", "lidar_height_m", "columns", "scale_intensity", "classes")
    classes = USUAL_CLASSES

    def open(self, source: Path, options: ImportOptions) -> PointFolder:
        """See `DriveForm.open`."""
        folder, files = _cloud_files(source)
        columns = _columns(files[0], options)
        tables = (source, folder)
        poses_file = _beside(tables, (POSES,), Path.is_file)
        pose_times, poses = read_poses(poses_file) if poses_file else (None, [])
        stamps, about_times = _stamps(files, tables, options.interval_s, pose_times)
        labels = _beside(tables, (LABELS,), Path.is_dir)
        notes = [about_times]
        if options.lidar_height_m is None:
            notes.append("The LiDAR's height is unknown: base_link is at the LiDAR (see --lidar-height).")
        if labels is not None:
            notes += _stray_labels(labels, files)
        return PointFolder(
            source.resolve().name,
            tuple(files),
            tuple(stamps),
            _poses_of(poses_file, stamps, pose_times, poses) if poses_file else None,
            labels,
            se3_from_yaw((0.0, 0.0, options.lidar_height_m or 0.0), 0.0),
            columns,
            1.0 if options.scale_intensity is None else options.scale_intensity,
            self.class_map(options),
            tuple(notes),
        )


@dataclass(frozen=True)
class PointFolder:
    """An opened folder: a drive as `DriveSource` describes it. poses: map_SE3_lidar of each file."""

    name: str
    files: Sequence[Path]
    stamps_ns: Sequence[int]
    poses: Sequence[Float64] | None
    labels: Path | None
    base_SE3_lidar: Float64
    columns: Sequence[str] | None
    scale_intensity: float
    class_map: Mapping[str, str]
    notes: Sequence[str]
    are_related: bool = True

    @property
    def frame_count(self) -> int:
        return len(self.files)

    @property
    def static_transforms(self) -> Sequence[tuple[str, str, Float64]]:
        return (("ego/base_link", "ego/lidar", self.base_SE3_lidar),)

    @property
    def fingerprint(self) -> str:
        """Changes with the name, size or time of any of the files."""
        about = [(file.name, (status := file.stat()).st_size, status.st_mtime_ns) for file in self.files]
        return hashlib.sha256(repr(about).encode(errors="surrogateescape")).hexdigest()

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """See `DriveSource.frames`."""
        for index in range(first, len(self.files)):
            file, stamp_ns = self.files[index], self.stamps_ns[index]
            cloud = read_point_file(file, self.columns, self.scale_intensity, stamp_ns)
            boxes, ignored = self._boxes(file)
            pose = None if self.poses is None else self.poses[index] @ invert(self.base_SE3_lidar)
            vehicle = VehicleFrame({"lidar": cloud}, boxes, ignored=ignored, map_SE3_base=pose)
            yield DriveFrame(str(file), stamp_ns, {"ego": vehicle}, file.stem)

    def class_names(self) -> Collection[str]:
        """The classes of the files of boxes."""
        if self.labels is None:
            return ()
        files = (self.labels / f"{file.stem}.txt" for file in self.files)
        return {box.class_name for file in files if file.exists() for box in read_boxes(file)}

    def _boxes(self, file: Path) -> tuple[Boxes | None, IgnoredBoxes]:
        if self.labels is None or not (labels := self.labels / f"{file.stem}.txt").exists():
            return None, IgnoredBoxes()
        named = read_boxes(labels)
        try:
            return sort_named_boxes(named, self.class_map)
        except AdvpipeError as error:
            raise AdvpipeError(f"{labels}: {error}") from None


def _cloud_files(source: Path) -> tuple[Path, list[Path]]:
    """The folder with the clouds, the source itself or the only one in it, and the clouds in order."""
    if not source.is_dir():
        what = "is not a folder" if source.exists() else "does not exist"
        raise UsageError(f"{source} {what}; give a folder of {', '.join(POINT_READERS)} files")
    try:
        own = _clouds_in(source)
        inner = (
            {}
            if own
            else {f: found for f in sorted(source.iterdir()) if f.is_dir() and (found := _clouds_in(f))}
        )
    except OSError as error:
        raise UsageError(f"{source}: cannot be read: {error.strerror or error}") from None
    if len(inner) > 1:
        raise UsageError(f"{source} has several folders of clouds ({_some(inner)}); give one of them")
    if not own and not inner:
        raise UsageError(f"{source} holds no clouds: no file ends in {', '.join(POINT_READERS)}")
    folder, files = (source, own) if own else next(iter(inner.items()))
    if len(suffixes := sorted({file.suffix.lower() for file in files})) > 1:
        raise UsageError(f"{folder} mixes {' and '.join(suffixes)} files; keep one type in a folder")
    stems: dict[str, Path] = {}
    for file in files:
        if (other := stems.setdefault(file.stem, file)) is not file:
            raise UsageError(f"{folder} holds both {other.name} and {file.name}; keep one of them")
    return folder, files


def _clouds_in(folder: Path) -> list[Path]:
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if _is_cloud(entry)]
    return [folder / name for name in sorted(names, key=natural_order)]


def _is_cloud(entry: os.DirEntry[str]) -> bool:
    suffix = os.path.splitext(entry.name)[1].lower()
    return suffix in POINT_READERS and not entry.name.startswith(".") and entry.is_file()


def natural_order(name: str) -> tuple[list[tuple[int, int, str]], str]:
    """A key by which `2.pcd` comes before `10.pcd`."""
    parts = re.findall(r"[0-9]{1,30}|[^0-9]+", name)
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts], name


def _columns(file: Path, options: ImportOptions) -> tuple[str, ...] | None:
    if options.columns is None:
        return None
    if file.suffix.lower() in (".pcd", ".ply"):
        raise UsageError(f"{file} names its columns itself; leave --columns out")
    return parse_columns(options.columns)


def _beside(folders: Sequence[Path], names: Sequence[str], exists: Callable[[Path], bool]) -> Path | None:
    """The first of the names in any of the folders."""
    places = (folder / name for folder in folders for name in names)
    return next((place for place in places if exists(place)), None)


def _stamps(
    files: Sequence[Path], folders: Sequence[Path], interval_s: float | None, pose_times: list[int] | None
) -> tuple[list[int], str]:
    """The stamp of each cloud, and where they come from."""
    if interval_s is not None:
        if not 1e-6 <= interval_s < 1e6:
            raise UsageError(f"the interval {interval_s:g} s is not between 1e-6 and 1e6 s")
        return _regular(len(files), interval_s), f"Stamps: every {interval_s:g} s, as --interval says."
    if (table := _beside(folders, TIMES, Path.is_file)) is not None:
        times = read_times(table)
        if len(times) != len(files):
            raise UsageError(f"{table} has {len(times)} times for {len(files)} clouds; give one for each")
        return times, f"Stamps: from {table.name}."
    from_names = [_stamp_in(file.stem) for file in files]
    stamps = [stamp for stamp in from_names if stamp is not None]
    if len(stamps) == len(files):
        return stamps, "Stamps: from the names of the files."
    if pose_times is not None and len(pose_times) == len(files):
        return pose_times, f"Stamps: from {POSES}."
    about = f"Stamps: every {DEFAULT_INTERVAL_S:g} s, as nothing says otherwise (see --interval)."
    return _regular(len(files), DEFAULT_INTERVAL_S), about


def _regular(count: int, interval_s: float) -> list[int]:
    return [1_000_000_000 + round(index * interval_s * 1e9) for index in range(count)]


def _stamp_in(stem: str) -> int | None:
    """The time since 1970 in a name; None where it has none, or several numbers of that length."""
    found = [match for match in _STAMP.finditer(stem) if _is_alone(stem, match)]
    if len(found) != 1:
        return None
    return time_ns(f"{found[0][1]}.{found[0][2]}" if found[0][1] else found[0][0])


def _is_alone(stem: str, match: re.Match[str]) -> bool:
    return not (stem[: match.start()][-1:].isdigit() or stem[match.end() :][:1].isdigit())


def _poses_of(
    file: Path, stamps: Sequence[int], times: list[int] | None, poses: Sequence[Float64]
) -> list[Float64]:
    """The pose of each cloud: line by line, or the nearest in time."""
    if times is None or len(poses) == len(stamps):
        if len(poses) != len(stamps):
            raise UsageError(f"{file} has {len(poses)} poses for {len(stamps)} clouds; give one for each")
        return list(poses)
    if not poses:
        raise UsageError(f"{file} holds no poses")
    order = np.argsort(times, kind="stable")
    ascending = np.array(times, np.int64)[order]
    nearest = []
    for stamp in stamps:
        place = int(np.searchsorted(ascending, stamp))
        near = [k for k in (place - 1, place) if 0 <= k < len(ascending)]
        best = min(near, key=lambda k: abs(int(ascending[k]) - stamp))
        if abs(int(ascending[best]) - stamp) > _FARTHEST_POSE_NS:
            raise UsageError(f"{file} has no pose within 0.1 s of the cloud at {stamp} ns")
        nearest.append(poses[int(order[best])])
    return nearest


def _stray_labels(labels: Path, files: Sequence[Path]) -> list[str]:
    stems = {file.stem for file in files}
    named = sorted((file for file in labels.glob("*.txt")), key=lambda file: natural_order(file.name))
    strays = [file for file in named if file.stem not in stems]
    if strays and len(strays) == len(named):
        raise UsageError(
            f"{labels} has labels for none of the clouds: {strays[0].name} has no {files[0].suffix} file"
        )
    notes = []
    if strays:
        notes.append(f"Files in {LABELS}/ without a cloud: {len(strays)}, such as {strays[0].name}.")
    if missing := len(stems) - (len(named) - len(strays)):
        notes.append(f"Clouds without labels: {missing} of {len(stems)}; they count as not labelled.")
    return notes


def _some(folders: Mapping[Path, object]) -> str:
    names = [f"{folder.name}/" for folder in folders]
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
