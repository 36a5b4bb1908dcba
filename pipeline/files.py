"""Outputs appear whole or not at all: made beside their final place, then renamed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.errors import OutputExistsError


@contextmanager
def staged_folder(final: Path, overwrite: bool) -> Iterator[Path]:
    """A folder to fill, which becomes `final` when the block ends without an error.

    What an earlier run that was killed left behind is removed. With `overwrite`, an old `final` stays
    until the new one is whole.
    """
    if final.exists() and not overwrite:
        raise OutputExistsError(final)
    partial = beside(final, "partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    try:
        yield partial
        replace_folder(partial, final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def staged_dataset(final: Path, overwrite: bool) -> Iterator[Path]:
    """A data set folder to fill with a clean bag; with `overwrite`, old attacks and reports stay in it."""
    if final.exists() and not overwrite:
        raise OutputExistsError(final)
    partial = beside(final, "partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    try:
        yield partial
        if final.is_dir():
            for item in partial.iterdir():
                replace_folder(item, final / item.name)
        else:
            partial.rename(final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def beside(final: Path, purpose: str) -> Path:
    """The hidden name beside a final name, on the same file system."""
    return final.parent / f".{final.name}.{purpose}"


def replace_folder(new: Path, final: Path) -> None:
    """Puts a finished file or folder in its final place, in exchange for an old one there."""
    if not final.exists():
        new.rename(final)
        return
    old = beside(final, "old")
    shutil.rmtree(old, ignore_errors=True)
    final.rename(old)
    new.rename(final)
    if old.is_dir():
        shutil.rmtree(old)
    else:
        old.unlink()
