"""Frames that are done, kept on disk until the whole attack is: a killed run goes on where it stopped."""

from __future__ import annotations

import os
import shutil
import zipfile
from pathlib import Path

import numpy as np

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.attack.lidar.base import LidarResult, PointLabels


class Job:
    """The hidden folder `.<name>.job` beside an output: one file a finished frame.

    request: everything that decides a frame's result, as text. A folder that another request left
    behind is emptied.
    """

    def __init__(self, out: Path, request: str) -> None:
        self.folder = out.parent / f".{out.name}.job"
        note = self.folder / "request.yaml"
        if not note.is_file() or note.read_text(encoding="utf-8") != request:
            shutil.rmtree(self.folder, ignore_errors=True)
            self.folder.mkdir(parents=True)
            note.write_text(request, encoding="utf-8")

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

    def remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def _file(self, index: int) -> Path:
        return self.folder / f"{index:06d}.npz"
