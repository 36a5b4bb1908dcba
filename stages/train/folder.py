"""The folder of one training run: its files, and whether a run may start or resume in it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.core.leftover_names import is_leftover_name
from advpipe.pipeline.core.lock import LOCK_NAME, take_lock, take_stale_lock
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.detector.device import device_record
from advpipe.stages.train.config import TrainConfig


@dataclass(frozen=True)
class RunFolder:
    """detector.safetensors, config.json, train.csv, validation.csv and training.png; state.pt,
    latest.safetensors and frames/ (decoded clouds) only while the run is not finished."""

    path: Path

    @property
    def checkpoint(self) -> Path:
        return self.path / "detector.safetensors"

    @property
    def config(self) -> Path:
        return self.path / "config.json"

    @property
    def log(self) -> Path:
        return self.path / "train.csv"

    @property
    def validations(self) -> Path:
        return self.path / "validation.csv"

    @property
    def picture(self) -> Path:
        return self.path / "training.png"

    @property
    def state(self) -> Path:
        return self.path / "state.pt"

    @property
    def latest(self) -> Path:
        return self.path / "latest.safetensors"

    @property
    def frames(self) -> Path:
        return self.path / "frames"

    @contextmanager
    def locked(self, overwrite: bool) -> Iterator[None]:
        """The folder, made if need be, is this run's alone within the block.

        Where the block ends with an error before a state was saved, there is nothing to go on from: all that
        the run made goes. Raises AdvpipeError where no run may start or go on, see `refuse`, and while
        another run is at work there.
        """
        self._tidy_finished()
        self.refuse(overwrite)
        new_folders = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        self.path.mkdir(parents=True, exist_ok=True)
        lock_file = self.path / LOCK_NAME
        lock = None
        try:
            lock = take_lock(lock_file)
            if lock is None:
                raise AdvpipeError(
                    f"{self.path} is locked by another run; wait until it ends, or choose another folder"
                )
            self.refuse(overwrite)  # again: that run may have finished meanwhile
            yield
        except BaseException:
            if lock is not None and not self.checkpoint.exists() and not self.state.exists():
                self._discard()
            raise
        finally:
            if lock is not None:
                lock_file.unlink(missing_ok=True)
                lock.close()
            with suppress(OSError):  # the first one that holds something
                for folder in new_folders:
                    folder.rmdir()

    def refuse(self, overwrite: bool) -> None:
        """Raises AdvpipeError where no run may start or go on, whatever it is to learn from."""
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"{self.path} is a file; name a folder for the training run")
        if self.path.exists() and not self._is_run() and (foreign := self._foreign()):
            raise UsageError(
                f"{self.path} is not empty ({foreign}) and holds no training run; choose another folder"
            )
        if self.checkpoint.exists() and not overwrite:
            raise OutputExistsError(self.checkpoint)

    def open(self, config: TrainConfig, origin: Mapping[str, str], overwrite: bool) -> None:
        """Make the folder, or accept the unfinished run of the same configuration in it; see `refuse`.

        origin: checksums of the files that the configuration names, which may change under their names.
        """
        # The number of processes changes no result, so a run may go on with another.
        about = {**asdict(config), "workers": None, "origin": dict(origin)}
        del about["device"]
        about |= device_record(config.device)
        wanted = json.dumps(about, default=str, indent=2, sort_keys=True) + "\n"
        if overwrite:
            for file in (self.checkpoint, self.latest, self.state, self.log, self.validations, self.picture):
                file.unlink(missing_ok=True)
        elif self.state.is_file() and self.config.read_text(encoding="utf-8") != wanted:
            raise UsageError(
                f"{self.path} holds an unfinished run with another configuration or other bags; "
                f"pass {option_name('overwrite', True)} to start anew, or choose another folder"
            )
        write_atomically(self.config, wanted.encode())

    def _is_run(self) -> bool:
        """Whether the folder's config.json is one of ours; others use that name too."""
        try:
            about = plain_json.load_json(self.config.read_bytes())
        except (OSError, ValueError):
            return False
        return isinstance(about, dict) and about.keys() >= {"bags", "preset", "origin"}

    def _foreign(self) -> str | None:
        """Something in the folder that no killed run left there."""
        names = (path.name for path in sorted(self.path.iterdir()))
        return next((name for name in names if name != LOCK_NAME and not is_leftover_name(name)), None)

    def _discard(self) -> None:
        """Remove all that a run made."""
        self.tidy()
        for file in (self.config, self.log, self.validations, self.picture):
            file.unlink(missing_ok=True)

    def _tidy_finished(self) -> None:
        """A run may have been killed when all was done but this."""
        is_untidy = any(path.exists() for path in (self.state, self.latest, self.frames))
        if not self.checkpoint.exists() or not is_untidy:
            return
        if lock := take_stale_lock(self.path / LOCK_NAME):
            with lock:
                self.tidy()
                (self.path / LOCK_NAME).unlink(missing_ok=True)

    def tidy(self) -> None:
        """Remove what only an unfinished run needs."""
        self.state.unlink(missing_ok=True)
        self.latest.unlink(missing_ok=True)
        shutil.rmtree(self.frames, ignore_errors=True)
