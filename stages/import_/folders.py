"""Files of folders: clouds by name, splits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.import_.point_files import COLUMN_NAMES, POINT_READERS, cloud_of_columns, read_floats

INTERVAL_S = 5.0
"""Between frames that nothing relates: each is then a block of its own where intervals are drawn."""


def frame_interval_ns(interval_s: float | None) -> int:
    """The time between frames without time stamps. Raises UsageError for none."""
    interval_ns = round((INTERVAL_S if interval_s is None else interval_s) * 1e9)
    if interval_ns <= 0:
        raise UsageError("--interval 0: frames follow one another; give seconds above 0, such as 0.1")
    return interval_ns


def file_names(folder: Path, suffix: str) -> list[str]:
    """The names without suffix of a folder's files, sorted; none for a folder that is missing."""
    return sorted(file.stem for file in folder.glob(f"*{suffix}") if not file.name.startswith("."))


def cloud_names(folder: Path, suffix: str) -> list[str]:
    """The names without suffix of a folder's clouds, sorted. Raises UsageError for clouds of another type."""
    for other in sorted(set(POINT_READERS) - {suffix}):
        if mixed := file_names(folder, other):
            found = counted(len(mixed), f"{other} file")
            raise UsageError(
                f"{folder / mixed[0]}{other}: {folder.name} holds {found}, where "
                f"this form has {suffix} alone; remove them, or import one type as `files`"
            )
    return file_names(folder, suffix)


def stray_notes(folder: Path, suffix: str) -> list[str]:
    """A sentence about what else lies in a folder of clouds; none where there is nothing else."""
    strays = sorted(
        entry.name
        for entry in folder.iterdir()
        if not entry.name.startswith(".") and (entry.suffix != suffix or not entry.is_file())
    )
    if not strays:
        return []
    more = f" and {len(strays) - 1} more" if len(strays) > 1 else ""
    return [f"{folder.name} holds what is no {suffix} file, and is left out: {strays[0]}{more}"]


def numbered_clouds(folder: Path, digits: int) -> list[int]:
    """The numbers of a folder's .bin files, sorted. Raises UsageError for none, and for another name."""
    names = cloud_names(folder, ".bin")
    if not names:
        raise UsageError(f"{folder} holds no .bin files; unpack the drive's clouds there")
    for name in names:
        if not (name.isascii() and name.isdigit() and len(name) == digits):
            raise UsageError(
                f"{folder / name}.bin: KITTI names its clouds by {digits} digits; remove it, or import the "
                "folder as `files`"
            )
    return [int(name) for name in names]


def read_split(folders: Sequence[Path], split: str) -> list[str]:
    """The names of a split in ImageSets/<split>.txt of the first folder that has it. Raises UsageError."""
    for folder in folders:
        file = folder / "ImageSets" / f"{split}.txt"
        if file.is_file():
            names = read_text(file).split()
            if not names:
                raise UsageError(f"{file} is empty; list a frame a line, or leave --split out")
            if len(set(names)) < len(names):
                raise UsageError(f"{file} lists {_repeated(names)} twice; list each frame once")
            return names
    known = sorted({name for folder in folders for name in file_names(folder / "ImageSets", ".txt")})
    has = f"it has {', '.join(known)}" if known else "there is no such folder"
    raise UsageError(f"{folders[0]}: no ImageSets/{split}.txt; {has}; leave --split out for all frames")


def refuse_missing(folder: Path, suffix: str, wanted: Sequence[str], has: Sequence[str], fix: str) -> None:
    """Raise UsageError if files of a folder are missing. wanted, has: names without suffix."""
    missing = sorted(set(wanted) - set(has))
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise UsageError(f"{folder / missing[0]}{suffix} is missing{more}; {fix}")


def read_cloud(file: Path, scale_intensity: float | None) -> Cloud:
    """A cloud of four float32 a point. Raises AdvpipeError for a truncated file."""
    return cloud_of_columns(
        read_floats(file, 4), COLUMN_NAMES[:4], 1.0 if scale_intensity is None else scale_intensity
    )


def _repeated(names: Sequence[str]) -> str:
    return next(name for number, name in enumerate(names) if name in names[:number])
