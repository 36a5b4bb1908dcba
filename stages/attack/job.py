"""Finished frames, kept on disk until the whole attack is done, so that a killed run can resume."""

from __future__ import annotations

import glob
import hashlib
import os
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.lock import LOCK_NAME, one_at_a_time, remove_folder, take_lock, take_stale_lock
from advpipe.pipeline.labels.points import PointLabels
from advpipe.stages.attack.lidar.base import LidarResult

_HASH_LENGTH = 12
_PARTIAL = ".partial"


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
            return None  # missing, or truncated by a power failure

    def require(self, index: int) -> LidarResult:
        """The result of a frame that is done."""
        result = self.load(index)
        if result is None:
            raise AdvpipeError(f"{self._file(index)} vanished or was damaged; run the attack again")
        return result

    def store(self, index: int, result: LidarResult) -> None:
        """Keep the result of a frame; a killed run leaves the whole of it or nothing."""
        file, labels = self._file(index), result.labels
        # A worker of a killed run may still be at the same frame.
        partial = file.with_suffix(f".{os.getpid()}{_PARTIAL}")
        try:
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
        except BaseException:
            partial.unlink(missing_ok=True)
            raise

    def _file(self, index: int) -> Path:
        return self.folder / f"{index:06d}.npz"


@contextmanager
def open_job(out: Path, request: str) -> Iterator[Job]:
    """The job of a request, in the hidden folder `.<name>.<hash of the request>.job` beside an output.

    request: everything that decides a frame's result, as text. The folder is this run's alone while the
    block lasts. It is removed at the end of the block, unless an error ends it and there are finished frames
    to resume from; what dead runs of other requests for the same output left is removed at once. Raises
    AdvpipeError while another run of the same request is alive.
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
        _remove(folder.glob(f"*{_PARTIAL}"))
        try:
            yield Job(folder)
            is_done = True
        finally:
            if is_done or not any(folder.glob("*.npz")):
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
