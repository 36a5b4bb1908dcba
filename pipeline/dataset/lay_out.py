"""A data set's files, which may lie anywhere, as one folder that appears when it is whole."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError, writing
from advpipe.pipeline.core.hashing import copy
from advpipe.pipeline.core.partial import PartialFolder
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.layout import is_dataset, read_layout


def write_folder(files: Mapping[str, Path], folder: Path, *, overwrite: bool = False) -> None:
    """Copy files, SHA256SUMS among them, to their relative paths in a new folder.

    Raises AdvpipeError for a file that is not what SHA256SUMS says, and for a folder that exists; with
    `overwrite`, one that `write_folder` made, and in which nothing else lies, is replaced.
    """

    def may_replace(old: Path) -> bool:
        refuse_folder(old, overwrite=overwrite)
        return True

    if folder.exists():
        refuse_folder(folder, overwrite=overwrite)
    sums = checksums.of_files(files)
    partial = PartialFolder(folder)
    try:
        with writing(folder):
            for name in track(sorted(files), f"copying to {folder}"):
                digest = _copy(files[name], partial.path / name)
                if name not in checksums.UNLISTED and digest != sums[name]:
                    raise AdvpipeError(f"{files[name]} changed while it was copied; nothing was written")
        partial.commit(may_replace)
    except BaseException:
        partial.discard()
        raise


def refuse_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse an output that exists, unless `write_folder` made it and it may be replaced (AdvpipeError)."""
    if not overwrite:
        raise OutputExistsError(folder)
    if not is_dataset(folder) or not (folder / checksums.FILE).is_file():
        raise UsageError(
            f"{folder} is not a shared data set (it has no {checksums.FILE}) and is not replaced; "
            "choose another "
            "name"
        )
    found = read_layout(folder)
    found.refuse_running()
    strangers = set(checksums.listed_files(folder)) - checksums.read(folder).keys()
    own = sorted(name for name in strangers if not any(left.holds(folder / name) for left in found.leftovers))
    if own:
        raise UsageError(
            f"{folder} also holds {own[0]}, which `share` did not make, and is not replaced; choose "
            "another name"
        )


def _copy(source: Path, target: Path) -> str:
    """The SHA-256 of what was copied."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with source.open("rb") as stream, target.open("xb") as out:
        return copy(stream.read, out.write, os.fstat(stream.fileno()).st_size)[0]
