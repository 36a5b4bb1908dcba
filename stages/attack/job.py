"""Frames that are done, kept on disk until the whole attack is: a killed run goes on where it stopped."""

from __future__ import annotations

import glob
import hashlib
import os
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.attack.lidar.base import LidarResult, PointLabels

try:
    import fcntl
except ImportError:  # Windows: two runs at once are not told apart, and leftovers stay
    fcntl = None  # type: ignore[assignment]

_HASH_LENGTH = 12


@dataclass(frozen=True)
class Job:
    """A folder with one file a finished frame."""

    folder: Path

    def load(self, index: int) -> LidarResult | None:
        """The result of a frame; None while it is not done."""
        try:
            with np.load(self._file(index), allow_pickle=False) as stored:
                labels = PointLabels(stored["point"], stored["action"], stored["displacement_m"])
                before, after = (float(loss) for loss in stored["loss"])
                return LidarResult(stored["cloud"], labels, before, after, str(stored["note"]))
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None  # not there, or cut off by a power failure

    def require(self, index: int) -> LidarResult:
        """The result of a frame that is done."""
        result = self.load(index)
        if result is None:
            raise AdvpipeError(f"{self._file(index)} vanished or was damaged; run the attack again")
        return result

    def store(self, index: int, result: LidarResult) -> None:
        """Keep the result of a frame; a killed run leaves the whole of it or nothing."""
        file, labels = self._file(index), result.labels
        partial = file.with_suffix(".partial")
        with partial.open("wb") as stream:
            np.savez(
                stream,
                cloud=result.cloud,
                point=labels.point,
                action=labels.action,
                displacement_m=labels.displacement_m,
                loss=np.array([result.loss_before, result.loss_after]),
                note=np.array(result.note),
            )
        os.replace(partial, file)

    def _file(self, index: int) -> Path:
        return self.folder / f"{index:06d}.npz"


@contextmanager
def open_job(out: Path, request: str) -> Iterator[Job]:
    """The job of a request, in the hidden folder `.<name>.<hash of the request>.job` beside an output.

    request: everything that decides a frame's result, as text. The folder is this run's alone while the
    block lasts, and goes when it ends without an error; what dead runs of other requests for the same
    output left goes at once. Raises AdvpipeError while another run of the same request is alive.
    """
    digest = hashlib.sha256(request.encode()).hexdigest()[:_HASH_LENGTH]
    folder = out.parent / f".{out.name}.{digest}.job"
    _remove_leftovers(out, folder)
    folder.mkdir(parents=True, exist_ok=True)
    lock = _lock(folder)
    if lock is None:
        raise AdvpipeError(f"{out}: another run is at it; wait until it ends, or choose another output")
    with lock:
        yield Job(folder)
        shutil.rmtree(folder, ignore_errors=True)


def _remove_leftovers(out: Path, own: Path) -> None:
    any_hash = "?" * _HASH_LENGTH
    for folder in out.parent.glob(f".{glob.escape(out.name)}.{any_hash}.job"):
        if fcntl is not None and folder != own and (lock := _lock(folder)):
            with lock:
                shutil.rmtree(folder, ignore_errors=True)


def _lock(folder: Path) -> IO[str] | None:
    """The lock of a folder, held until it is closed or its process dies; None if another run holds it."""
    try:
        lock = (folder / ".lock").open("w")
    except OSError:  # removed meanwhile, or not ours
        return None
    try:
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        (folder / ".lock").stat()  # gone with the run that held it until now
    except OSError:
        lock.close()
        return None
    return lock
