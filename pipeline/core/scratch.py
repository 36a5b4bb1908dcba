"""A folder for temporary files, which `advpipe clean` recognises after a kill."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from advpipe.pipeline.core.lock import LOCK_NAME, take_lock

PREFIX = "advpipe-"
FILES_NAME = "files"
"""The folder in it that is used, made when the lock is there."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """An empty folder where temporary files go, removed with all that is in it when the block ends."""
    with (
        tempfile.TemporaryDirectory(prefix=PREFIX) as name,
        take_lock(Path(name) / LOCK_NAME) or nullcontext(),
    ):
        files = Path(name) / FILES_NAME
        files.mkdir()
        yield files
