"""The folder of one training run: what lies where, and whether a run may start or go on in it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from advpipe.pipeline.detector.device import device_record
from advpipe.pipeline.errors import OutputExistsError, UsageError
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

    def refuse(self, overwrite: bool) -> None:
        """Raises AdvpipeError where no run may start or go on, whatever it is to learn from."""
        if self.path.exists() and not self.path.is_dir():
            raise UsageError(f"{self.path} is a file; name a folder for the training run")
        if self.path.exists() and not self._is_run() and any(self.path.iterdir()):
            raise UsageError(f"{self.path} is not empty and holds no training run; choose another folder")
        if self.checkpoint.exists() and not overwrite:
            self.tidy()  # a kill may have come in between
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
        elif self.config.is_file() and self.config.read_text(encoding="utf-8") != wanted:
            raise UsageError(
                f"{self.path} holds an unfinished run with another configuration or other bags; "
                "pass --overwrite to start anew, or choose another folder"
            )
        self.path.mkdir(parents=True, exist_ok=True)
        beside = self.path / f".{self.config.name}.part"
        beside.write_text(wanted, encoding="utf-8")
        os.replace(beside, self.config)

    def _is_run(self) -> bool:
        """Whether the folder's config.json is one of ours; others use that name too."""
        try:
            about = json.loads(self.config.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        return isinstance(about, dict) and about.keys() >= {"bags", "preset", "origin"}

    def tidy(self) -> None:
        """Remove what only an unfinished run needs."""
        self.state.unlink(missing_ok=True)
        self.latest.unlink(missing_ok=True)
        shutil.rmtree(self.frames, ignore_errors=True)
