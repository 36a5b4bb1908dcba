"""Finished frames, kept on disk until the whole attack is done, so that a killed run can resume."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_folder import PARTIAL_SUFFIX, job_folder
from advpipe.pipeline.labels.points import PointLabels
from advpipe.stages.attack.lidar.base import LidarResult

NO_PLACES = np.zeros(0, np.int64)
"""Stands for `PointLabels.attacked` where it is None."""


@dataclass(frozen=True)
class Job:
    """A folder with one file a finished frame."""

    folder: Path

    def load(self, index: int) -> LidarResult | None:
        """The result of a frame; None while it is not done."""
        try:
            with np.load(self._file(index), allow_pickle=False) as stored:
                own = stored["point"], stored["action"], stored["displacement_m"]
                places = stored["attacked"]
                labels = PointLabels(*own, places if len(places) == len(own[0]) else None)
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
        partial = file.with_suffix(f".{os.getpid()}{PARTIAL_SUFFIX}")
        try:
            with partial.open("wb") as stream:
                np.savez(
                    stream,
                    cloud=result.cloud,
                    point=labels.point,
                    action=labels.action,
                    displacement_m=labels.displacement_m,
                    attacked=NO_PLACES if labels.attacked is None else labels.attacked,
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
    """The job of a request for an output; see `core.job_folder`."""
    with job_folder(out, request, results="*.npz") as folder:
        yield Job(folder)
