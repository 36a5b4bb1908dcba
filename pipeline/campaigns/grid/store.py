"""The folder of a grid: one file a finished cell, so that a later run goes on where this one stopped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.campaigns.grid.cell import GridOrigin, StoredGridCell, cell_file_name
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.document import read_json, read_text
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.leftover_names import is_leftover_name
from advpipe.pipeline.core.option_names import option_name

GRID_CELLS = "cells"


@dataclass(frozen=True)
class GridStore:
    """The cells in `folder`/cells."""

    folder: Path

    def open(self) -> None:
        """Make the folder. Raises UsageError for one that is no grid's."""
        if self.folder.exists() and not self.folder.is_dir():
            raise UsageError(f"{self.folder} is no folder; choose another {option_name('out')}")
        names = [path.name for path in self.folder.iterdir()] if self.folder.is_dir() else []
        strangers = [name for name in names if not is_leftover_name(name)]
        if strangers and not (self.folder / GRID_CELLS).is_dir():
            raise UsageError(
                f"{self.folder} holds {min(strangers)} but no {GRID_CELLS}/, so it is no grid; "
                f"choose another {option_name('out')}"
            )
        (self.folder / GRID_CELLS).mkdir(parents=True, exist_ok=True)

    def load(self, identity: dict[str, Any], code_sha256: str, overwrite: bool) -> StoredGridCell | None:
        """The cell of this identity and code; None if it is not finished.

        Raises UsageError for a cell that other code made, unless `overwrite`, and AdvpipeError for an
        invalid file.
        """
        path = self._path(identity)
        if not path.is_file():
            return None
        hint = "remove it to compute it again"
        found: StoredGridCell = read_json(read_text(path), StoredGridCell, str(path), hint)
        if found.identity != identity:
            raise AdvpipeError(f"{path} holds another cell than its name says; {hint}")
        if found.origin.code_sha256 == code_sha256:
            return found
        if overwrite:
            return None
        raise UsageError(
            f"{path} was made by other code of advpipe ({found.origin.code_sha256[:12]}…, not "
            f"{code_sha256[:12]}…); give another {option_name('out')}, or pass "
            f"{option_name('overwrite', True)} to compute such cells again"
        )

    def save(self, cell: StoredGridCell) -> None:
        """Store a cell; a killed run leaves a whole file or none."""
        write_atomically(self._path(cell.identity), cell.to_json().encode())

    def _path(self, identity: dict[str, Any]) -> Path:
        return self.folder / GRID_CELLS / cell_file_name(identity)


def other_drive(kept: GridOrigin, clean_sha256: str, drive: Path) -> UsageError:
    """The error about a finished cell of a drive with other bytes, such as one of another version."""
    return UsageError(
        f"{drive} is not the drive of its finished cells (SHA-256 {clean_sha256[:12]}…, not "
        f"{kept.clean_sha256[:12]}…); pass {option_name('overwrite', True)} to compute them again"
    )
