"""File locks that end with their process, which distinguish the files of a running command from leftovers."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO
from weakref import WeakSet

try:
    import fcntl
except ImportError:  # Windows: undecidable, so leftovers of killed runs stay until removed by hand
    fcntl = None  # type: ignore[assignment]

LOCK_NAME = ".lock"
"""The file in a folder that a run keeps locked while it fills the folder."""

HAS_LOCKS = fcntl is not None

_PATIENCE_S, _PAUSE_S = 0.2, 0.02  # other runs take a lock for an instant to test whether its run is alive


_taken: WeakSet[IO[bytes]] = WeakSet()


def _close_taken() -> None:
    for stream in tuple(_taken):
        stream.close()


if hasattr(os, "register_at_fork"):
    # A forked worker that briefly outlives its killed parent would keep the parent's locks.
    os.register_at_fork(after_in_child=_close_taken)


def take_lock(file: Path, patience_s: float = _PATIENCE_S) -> IO[bytes] | None:
    """Take the lock of a file, which is created if missing; it holds until it is closed or the process ends.

    None while another run holds it, and if that run removed the folder. patience_s: how long to retry. Raises
    OSError if the file can be neither opened nor created.
    """
    deadline_s = time.monotonic() + patience_s
    while True:
        try:
            stream = os.fdopen(os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666), "r+b")
        except FileNotFoundError:
            return None
        try:
            if fcntl is not None:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(stream.fileno()), file.stat()):
                _taken.add(stream)
                return stream
        except OSError:  # held by another run, or removed by it meanwhile
            pass
        stream.close()
        if time.monotonic() > deadline_s:
            return None
        time.sleep(_PAUSE_S)


def take_stale_lock(file: Path) -> IO[bytes] | None:
    """Take the lock that a killed run left; None if its run is alive or this user cannot write the file."""
    with suppress(OSError):
        return take_lock(file, patience_s=0) if HAS_LOCKS else None
    return None


def is_locked(file: Path) -> bool:
    """Whether a living run holds the lock of a file; the file is not created, and may be read-only."""
    if fcntl is None:
        return False
    try:
        with file.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:  # held, or unreadable: then its run may be alive
        return True
    return False


def remove_folder(folder: Path) -> None:
    """Remove a folder, its lock last, so that `advpipe clean` recognises what a killed run leaves of it.

    Files that cannot be removed stay; no error is raised.
    """
    with suppress(OSError):
        for path in sorted(folder.iterdir()):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != LOCK_NAME:
                path.unlink(missing_ok=True)
        (folder / LOCK_NAME).unlink(missing_ok=True)
        folder.rmdir()


@contextmanager
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Lock a folder while the block creates, renames or removes files in it, so that two runs never mix."""
    if fcntl is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems lock no folders
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
