"""The drive of several that --drive names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.import_.named_files import chosen_drive
from advpipe.stages.import_.options import ImportOptions


def chosen_folder(source: Path, drives: Mapping[str, Path], drive: str | None) -> Path:
    """The folder of the drive named `drive`, also by its number alone, or of the only one.

    Raises UsageError, which lists them.
    """
    by_number = [name for name in drives if drive is not None and drive == _number(name)]
    wanted = by_number[0] if len(by_number) == 1 else drive
    return drives[chosen_drive(source, "drive", sorted(drives), wanted)]


def refuse_options(options: ImportOptions, form: str) -> None:
    """Raise UsageError for options that only KITTI's object frames take."""
    if options.split is not None:
        raise UsageError(f"--split means nothing to KITTI's {form}; choose frames by --frames")
    if options.interval_s is not None:
        raise UsageError(f"--interval means nothing to KITTI's {form}, which has time stamps; leave it out")


def _number(name: str) -> str:
    """The number of a raw drive, 0005 of 2011_09_26_drive_0005_sync; else the name."""
    return name.partition("_drive_")[2].removesuffix("_sync") or name
