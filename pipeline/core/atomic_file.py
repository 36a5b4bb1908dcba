"""A file that appears under its name only when it is whole."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.core.errors import OutputExistsError, writing
from advpipe.pipeline.core.lock import one_at_a_time, take_lock, take_stale_lock

MARK = ".advpipe-partial-"
"""Between the final name and eight hexadecimal digits in the name of a hidden file."""


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """A hidden file beside `path` to write to; it becomes `path` when the block ends without an error.

    A killed run leaves the hidden file alone, and the next run that writes `path` removes it. An OSError
    about the hidden file names `path`.
    """
    beside = path.with_name(f".{path.name}{MARK}{secrets.token_hex(4)}")
    try:
        with one_at_a_time(path.parent):  # `advpipe clean` never sees it without its lock
            _remove_leftovers(path)
            lock = take_lock(beside)
        try:
            yield beside
            os.replace(beside, path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
        finally:
            if lock is not None:
                lock.close()
    except OSError as error:
        if error.filename in (beside, str(beside), path.parent, str(path.parent)):
            error.filename, error.filename2 = str(path), None
        raise


def write_atomically(path: Path, content: bytes) -> None:
    """The file is the old one or the new one, never half of it."""
    with atomic_file(path) as beside:
        beside.write_bytes(content)


def write_new(path: Path, text: str, overwrite: bool = False) -> None:
    """Writes a text whole or not at all; raises AdvpipeError for a file that exists, unless `overwrite`."""
    if path.exists() and not overwrite:
        raise OutputExistsError(path)
    with writing(path):
        write_atomically(path, text.encode())


def _remove_leftovers(path: Path) -> None:
    prefix = f".{path.name}{MARK}"
    for leftover in path.parent.iterdir():
        if leftover.name.startswith(prefix) and (lock := take_stale_lock(leftover)):
            with lock:
                leftover.unlink(missing_ok=True)
