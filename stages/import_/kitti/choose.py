"""The drive of several that --drive names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.import_.options import ImportOptions


def chosen_drive(source: Path, drives: Mapping[str, Path], drive: str | None) -> Path:
    """The folder of the drive named `drive`, or of the only one. Raises UsageError, which lists them."""
    if drive is None:
        if len(drives) == 1:
            return next(iter(drives.values()))
        raise UsageError(
            f"{source} holds {len(drives)} drives; choose one by --drive: {', '.join(sorted(drives))}"
        )
    matching = [name for name in drives if drive in (name, _number(name))]
    if len(matching) != 1:
        what = "no drive" if not matching else f"{len(matching)} drives"
        raise UsageError(f"{source} holds {what} named {drive!r}; choose one of {', '.join(sorted(drives))}")
    return drives[matching[0]]


def refuse_options(options: ImportOptions, form: str) -> None:
    """Raise UsageError for options that only KITTI's object frames take."""
    if options.split is not None:
        raise UsageError(f"--split means nothing to KITTI's {form}; choose frames by --frames")
    if options.interval_s is not None:
        raise UsageError(f"--interval means nothing to KITTI's {form}, which has time stamps; leave it out")


def _number(name: str) -> str:
    """The number of a raw drive, 0005 of 2011_09_26_drive_0005_sync; else the name."""
    return name.partition("_drive_")[2].removesuffix("_sync") or name
