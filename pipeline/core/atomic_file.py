"""Atomic writing of files: a file appears under its final name only when it is complete."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.core.errors import OutputExistsError, writing
from advpipe.pipeline.core.lock import one_at_a_time, take_lock, take_stale_lock

MARK = ".advpipe-partial-"
"""The name of a hidden file is `.`, the final name, this mark and eight hexadecimal digits."""


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a hidden file beside `path` to write to, and rename it to `path` if the block raises no error.

    A killed run leaves only the hidden file behind, and the next run that writes `path` removes it. Raises
    OSError, which names `path` even where the hidden file is at fault.
    """
    beside = path.with_name(f".{path.name}{MARK}{secrets.token_hex(4)}")
    try:
        with one_at_a_time(path.parent):  # so that `advpipe clean` never finds the file unlocked
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
    """Write the file so that it holds either its old content or the new, never a part. Raises OSError."""
    with atomic_file(path) as beside:
        beside.write_bytes(content)


def write_new(path: Path, text: str, overwrite: bool = False) -> None:
    """Write a text file atomically.

    Raises OutputExistsError for a file that exists, unless `overwrite`, and AdvpipeError for a full disk.
    """
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
