"""A folder for temporary files, which `advpipe clean` recognises after a kill."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

from advpipe.pipeline.core.lock import LOCK_NAME, take_lock

PREFIX = "advpipe-"
FILES_NAME = "files"
"""The folder inside that holds the files, made once the lock exists."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield an empty folder for temporary files; remove it with its content when the block ends."""
    with (
        tempfile.TemporaryDirectory(prefix=PREFIX) as name,
        take_lock(Path(name) / LOCK_NAME) or nullcontext(),
    ):
        files = Path(name) / FILES_NAME
        files.mkdir()
        yield files
