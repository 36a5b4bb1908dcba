"""What a command that writes a bag returns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.tabular import Tabular


@dataclass(frozen=True, repr=False)
class BagSummary(Tabular):
    """The summary of a bag that was written, which also converts to the bag's path."""

    bag: Path

    @property
    def data_set(self) -> Path:
        """The folder with the clean bag, to which attacks add theirs."""
        return self.bag.parent

    def __fspath__(self) -> str:
        return str(self.bag)
