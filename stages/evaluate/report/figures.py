"""The figures of a finished report in a folder of their own, in the format that a paper takes."""

from __future__ import annotations

import shutil
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.partial import FolderKind, staged_folder

FORMATS = ("pdf", "svg", "png")
"""In which `evaluate` draws each figure; points of clouds are pixels in all of them, the rest is vectors."""


def export_figures(report: Path, file_format: str, out: Path, overwrite: bool = False) -> tuple[Path, ...]:
    """Copy the figures of a report in one format to the folder `out`; the paths written, by name.

    report: the folder that `evaluate` wrote, or its report.html. Raises UsageError for another folder or
    format, AdvpipeError for a report that does not hold the format, OutputExistsError for an existing `out`
    without `overwrite`.
    """
    if file_format not in FORMATS:
        raise UsageError(f"unknown format {file_format!r}; known: {', '.join(FORMATS)}")
    folder = report.parent if report.is_file() else report
    if not (folder / "report.json").is_file():
        raise UsageError(
            f"{report} is not a report: it has no report.json; name a folder that evaluate wrote"
        )
    found = sorted(
        path
        for path in (folder / "figures").glob(f"*.{file_format}")
        if path.is_file() and not path.is_symlink()
    )
    if not found:
        raise AdvpipeError(f"{folder} holds no figures as {file_format.upper()}; evaluate again to draw them")
    names = tuple(path.name for path in found)
    with staged_folder(out, overwrite, FolderKind("folder of figures", names, ())) as partial:
        for path in found:
            shutil.copyfile(path, partial / path.name)
    return tuple(out / name for name in names)
