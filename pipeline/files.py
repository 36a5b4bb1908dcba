"""Outputs appear whole or not at all: made in a hidden folder beside their final place, then renamed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.bag.partial import PartialFolder
from advpipe.pipeline.errors import AdvpipeError, OutputExistsError


@contextmanager
def staged_folder(final: Path, overwrite: bool) -> Iterator[Path]:
    """A folder to fill; what is in it moves to `final` when the block ends without an error.

    With `overwrite`, an old `final` stays as it is until then, and items of it that are not made anew
    stay for good: attacks and reports of a data set whose drive is recorded again.
    """
    if final.exists() and not overwrite:
        raise OutputExistsError(final)
    if final.exists() and not final.is_dir():
        raise AdvpipeError(f"{final} is no folder, not replacing it; choose another name")
    partial = PartialFolder(final)
    try:
        yield partial.path
        if final.is_dir():
            _replace_items(partial.path, final)
            partial.discard()
        else:
            partial.commit(may_replace=lambda _: False)
    except BaseException:
        partial.discard()
        raise


def _replace_items(new: Path, final: Path) -> None:
    for item in sorted(new.iterdir()):
        if item.name.startswith("."):
            continue
        target, old = final / item.name, new / f".old.{item.name}"
        if target.exists():
            target.rename(old)
        item.rename(target)
        if old.is_dir():
            shutil.rmtree(old)
