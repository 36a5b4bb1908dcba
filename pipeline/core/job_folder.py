"""The hidden folder that keeps the finished parts of a long work, so that a killed run can resume."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.lock import LOCK_NAME, one_at_a_time, remove_folder, take_lock, take_stale_lock

_HASH_LENGTH = 12
PARTIAL_SUFFIX = ".partial"
"""Of files that a killed run may leave half-written in the folder."""


@contextmanager
def job_folder(out: Path, request: str, *, results: str) -> Iterator[Path]:
    """The folder `.<name>.<hash of the request>.job` beside an output.

    request: everything that decides a result, as text. results: a glob of the names that finished parts have.
    The folder is this run's alone while the block lasts. It is removed at the end of the block, unless an
    error ends it and there are results to resume from; what dead runs of other requests for the same output
    left is removed at once. Raises AdvpipeError while another run of the same request is alive.
    """
    digest = hashlib.sha256(request.encode()).hexdigest()[:_HASH_LENGTH]
    folder = out.parent / f".{out.name}.{digest}.job"
    new_parents = [parent for parent in out.parents if not parent.exists()]
    out.parent.mkdir(parents=True, exist_ok=True)
    with one_at_a_time(out.parent):
        _remove_leftovers(out, folder)
        folder.mkdir(exist_ok=True)
        try:
            lock = take_lock(folder / LOCK_NAME)
        except OSError:
            _remove_empty([folder, *new_parents])
            raise
    if lock is None:
        raise AdvpipeError(f"{out} is locked by another run; wait until it ends, or choose another output")
    is_done = False
    with lock:
        _remove(folder.glob(f"*{PARTIAL_SUFFIX}"))
        try:
            yield folder
            is_done = True
        finally:
            if is_done or not any(folder.glob(results)):
                remove_folder(folder)
                _remove_empty(new_parents)


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        file.unlink(missing_ok=True)


def _remove_empty(folders: Iterable[Path]) -> None:
    with suppress(OSError):  # the first one that holds something
        for folder in folders:
            folder.rmdir()


def _remove_leftovers(out: Path, own: Path) -> None:
    any_hash = "?" * _HASH_LENGTH
    for folder in out.parent.glob(f".{glob.escape(out.name)}.{any_hash}.job"):
        if folder != own and (lock := take_stale_lock(folder / LOCK_NAME)):
            with lock:
                remove_folder(folder)
