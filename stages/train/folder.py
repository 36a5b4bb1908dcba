"""The folder of one training run: its files, and whether a run may start or resume in it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, UsageError
from advpipe.pipeline.core.leftover_names import is_leftover_name
from advpipe.pipeline.core.lock import LOCK_NAME, take_lock, take_stale_lock
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.detector.device import device_record


@dataclass(frozen=True)
class RunFolder:
    """The files of a run; `state`, `latest` and `frames` exist only while it is unfinished."""

    path: Path

    @property
    def checkpoint(self) -> Path:
        """The trained detector."""
        return self.path / "detector.safetensors"

    @property
    def config(self) -> Path:
        """The run's configuration and the checksums of its inputs."""
        return self.path / "config.json"

    @property
    def log(self) -> Path:
        """The log of steps."""
        return self.path / "train.csv"

    @property
    def validations(self) -> Path:
        """The log of validations."""
        return self.path / "validation.csv"

    @property
    def picture(self) -> Path:
        """The plot of both logs."""
        return self.path / "training.png"

    @property
    def state(self) -> Path:
        """The state from which an unfinished run resumes."""
        return self.path / "state.pt"

    @property
    def latest(self) -> Path:
        """The latest weights of an unfinished run."""
        return self.path / "latest.safetensors"

    @property
    def frames(self) -> Path:
        """The decoded clouds of an unfinished run."""
        return self.path / "frames"

    @contextmanager
    def locked(self, overwrite: bool) -> Iterator[None]:
        """Lock the folder for this run within the block; create it if it does not exist.

        If the block fails before a state was saved, there is nothing to resume, so everything that the run
        made is removed. Raises AdvpipeError if no run may start or resume, see `refuse`, or while another run
        holds the lock.
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
            with suppress(OSError):  # the first one that is not empty
                for folder in new_folders:
                    folder.rmdir()

    def refuse(self, overwrite: bool) -> None:
        """Raise AdvpipeError if no run may start or resume here, whatever its configuration."""
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"{self.path} is a file; name a folder for the training run")
        if self.path.exists() and not self._is_run() and (foreign := self._foreign()):
            raise UsageError(
                f"{self.path} is not empty ({foreign}) and is not a training run; choose another folder"
            )
        if self.checkpoint.exists() and not overwrite:
            raise OutputExistsError(self.checkpoint)

    def open(self, config: Mapping[str, Any], origin: Mapping[str, str], overwrite: bool) -> None:
        """Start a run in the folder, or accept its unfinished run with the same configuration; see `refuse`.

        config: the fields of the run's configuration. origin: checksums of the files that the configuration
        names, since their contents may change.
        """
        # The number of processes does not change the result, so a run may resume with another.
        about = {**config, "workers": None, "origin": dict(origin)}
        about |= device_record(about.pop("device"))
        wanted = json.dumps(about, default=str, indent=2, sort_keys=True) + "\n"
        if overwrite:
            for file in (self.checkpoint, self.latest, self.state, self.log, self.validations, self.picture):
                file.unlink(missing_ok=True)
        elif self.state.is_file() and self.config.read_text(encoding="utf-8") != wanted:
            raise UsageError(
                f"{self.path} holds an unfinished run with another configuration or other bags; "
                f"pass {option_name('overwrite', True)} to start again, or choose another folder"
            )
        write_atomically(self.config, wanted.encode())

    def _is_run(self) -> bool:
        """Whether the folder's config.json is a training run's; other tools use that name too."""
        try:
            about = plain_json.load_json(self.config.read_bytes())
        except (OSError, ValueError):
            return False
        return isinstance(about, dict) and about.keys() >= {"bags", "preset", "origin"}

    def _foreign(self) -> str | None:
        """The name of a file in the folder that is not left over from a killed run."""
        names = (path.name for path in sorted(self.path.iterdir()))
        return next((name for name in names if name != LOCK_NAME and not is_leftover_name(name)), None)

    def _discard(self) -> None:
        """Remove all that a run made."""
        self.tidy()
        for file in (self.config, self.log, self.validations, self.picture):
            file.unlink(missing_ok=True)

    def _tidy_finished(self) -> None:
        """Tidy a finished run that was killed just before it tidied up."""
        is_untidy = any(path.exists() for path in (self.state, self.latest, self.frames))
        if not self.checkpoint.exists() or not is_untidy:
            return
        if lock := take_stale_lock(self.path / LOCK_NAME):
            with lock:
                self.tidy()
                (self.path / LOCK_NAME).unlink(missing_ok=True)

    def tidy(self) -> None:
        """Remove the files that only an unfinished run needs."""
        self.state.unlink(missing_ok=True)
        self.latest.unlink(missing_ok=True)
        shutil.rmtree(self.frames, ignore_errors=True)
