"""Recordings and data sets in formats that are no bag: each with the command that makes one of it."""

from __future__ import annotations

import shlex
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError

_ROS1 = b"#ROSBAG V"
_SQLITE = b"SQLite format 3\0"

_KITTI_POINT_BYTES = 16
"""x, y, z and reflectance, four bytes each."""

_CLOUDS: dict[str, tuple[bytes, ...]] = {
    ".pcd": (b"#", b"VERSION"),
    ".ply": (b"ply",),
    ".npy": (b"\x93NUMPY",),
}
"""How files of one point cloud begin, by their extension."""

_DATA_SETS = (
    ("nuScenes", "nuscenes", ("scene.json", "*/scene.json")),
    ("KITTI", "kitti", ("training/velodyne", "velodyne", "sequences/*/velodyne", "*_drive_*_sync")),
    ("KITTI", "kitti", ("velodyne_points", "*/*_drive_*_sync")),
    ("Argoverse 2", "av2", ("sensors/lidar", "*/sensors/lidar")),
    ("OPV2V", "opv2v", ("[0-9]*/*.pcd", "*/[0-9]*/*.pcd")),
)
"""Other data sets: their names, the forms that import them, and what is in a folder of one."""

_MOST_ENTRIES = 1000
"""Of a folder, that are looked at for a recording."""


def refuse_foreign(path: Path) -> None:
    """Raises UsageError for a ROS 1 bag, a bare .db3 and a point cloud, for a folder that holds some, and for
    a folder of another data set.

    Does nothing for any other path, also one that cannot be read.
    """
    try:
        found = _foreign_in(path) if path.is_dir() else _foreign(path)
    except OSError:
        return
    if found:
        raise UsageError(found)


def _foreign_in(folder: Path) -> str:
    """What the folder, or the first recording in it, is; "" where it is nothing known."""
    for title, form, patterns in _DATA_SETS:
        if any(next(folder.glob(pattern), None) for pattern in patterns):
            how = f"make a data set of it with {_import(form, folder)}"
            return f"{folder} is not a bag but looks like {title}; {how}"
    known = (".bag", ".db3", ".bin", *_CLOUDS)
    for _, entry in zip(range(_MOST_ENTRIES), folder.iterdir(), strict=False):
        if entry.suffix in known and entry.is_file() and (found := _foreign(entry)):
            return f"{folder} is not a bag: {found}"
    return ""


def _foreign(file: Path) -> str:
    """What a file is and what to do, in one line; "" for what is none of these formats."""
    size_bytes = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(len(_SQLITE))
    if head.startswith(_ROS1):
        return f"{file} is a ROS 1 bag; {_import('rosbag', file)}, or {_convert(file)}"
    if head == _SQLITE:
        return (
            f"{file} is the SQLite database of a ROS 2 bag, but advpipe reads mcap; "
            f"{_import('rosbag', file)}, or {_convert(file)}"
        )
    if head.startswith(_CLOUDS.get(file.suffix.lower(), ())):
        return (
            f"{file} is one point cloud; make a data set of its folder with {_import('files', file.parent)}"
        )
    if file.suffix == ".bin" and size_bytes and size_bytes % _KITTI_POINT_BYTES == 0:
        return (
            f"{file} looks like a KITTI cloud; make a data set of its folder with "
            f"{_import('files', file.parent)}, or of all of KITTI with `advpipe import kitti`"
        )
    return ""


def _import(form: str, source: Path) -> str:
    out = shlex.quote(f"datasets/{source.resolve().stem}")
    return f"`advpipe import {form} {shlex.quote(str(source))} --out {out}`"


def _convert(file: Path) -> str:
    source, target = shlex.quote(str(file)), shlex.quote(f"{file.stem}-mcap")
    return f"convert it with `rosbags-convert --src {source} --dst {target} --dst-storage mcap`"
