"""Locks that end with their process: they tell what a living run works on from what a killed run left."""

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
except ImportError:  # Windows: nobody can tell, so leftovers of killed runs stay until removed by hand
    fcntl = None  # type: ignore[assignment]

LOCK_NAME = ".lock"
"""The file in a folder that its run keeps locked."""

HAS_LOCKS = fcntl is not None

_PATIENCE_S, _PAUSE_S = 0.2, 0.02  # others hold a lock for an instant to see whether its run is alive


_taken: WeakSet[IO[bytes]] = WeakSet()


def _close_taken() -> None:
    for stream in tuple(_taken):
        stream.close()


if hasattr(os, "register_at_fork"):
    # A forked worker that outlives its killed parent for a moment would keep the parent's locks.
    os.register_at_fork(after_in_child=_close_taken)


def take_lock(file: Path, patience_s: float = _PATIENCE_S) -> IO[bytes] | None:
    """The lock of a file, made where it does not exist, until it is closed or the process dies.

    None while another run holds it, and where the folder went with that run. Raises OSError where the file
    can be neither opened nor made.
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
    """The lock that a dead run left; None where a run is alive, or where it is not ours to take."""
    with suppress(OSError):
        return take_lock(file, patience_s=0) if HAS_LOCKS else None
    return None


def is_locked(file: Path) -> bool:
    """Whether a living run holds the lock of a file; it is not made, and may be read-only."""
    if fcntl is None:
        return False
    try:
        with file.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except OSError:  # held, or unreadable: then nobody can say that its run is dead
        return True
    return False


def remove_folder(folder: Path) -> None:
    """Remove a folder with its lock last, so that a killed run leaves no folder that nobody recognises.

    What cannot be removed stays.
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
    """Between two runs, making, naming and removing things in one folder never mix."""
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
