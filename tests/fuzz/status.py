"""A worker's status in memory shared with the process that watches it."""

from __future__ import annotations

import mmap
import struct
import time
from pathlib import Path
from typing import NamedTuple

_LAYOUT = struct.Struct("<QQd")


class Progress(NamedTuple):
    """inputs: tried so far. batch: of the engine's. started_s: of the input on trial, 0 between two."""

    inputs: int = 0
    batch: int = 0
    started_s: float = 0.0


class Status:
    """A file that both map; times are of the machine's monotonic clock."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            path.write_bytes(bytes(_LAYOUT.size))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), _LAYOUT.size)

    def read(self) -> Progress:
        return Progress(*_LAYOUT.unpack(self._map[:]))

    def write(self, progress: Progress) -> None:
        self._map[:] = _LAYOUT.pack(*progress)

    def begin(self) -> None:
        self.write(self.read()._replace(started_s=time.monotonic()))

    def end(self) -> None:
        now = self.read()
        self.write(now._replace(inputs=now.inputs + 1, started_s=0.0))
