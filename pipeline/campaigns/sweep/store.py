"""The folder of a sweep: one file for each finished cell, so that a later run resumes where this one stopped.

The same sweep gives byte-identical files, interrupted or not, except for times.json.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from advpipe.pipeline.campaigns.sweep.budgets import BUDGETS
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings, Times
from advpipe.pipeline.campaigns.sweep.variants import with_seed_of
from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.leftover_names import is_leftover_name
from advpipe.pipeline.core.option_names import option_name

CELLS, TIMES = "cells", "times.json"

OF_RECIPES = ("frames", "defences", "detect_attacks")
"""Settings that may differ from recipe to recipe."""


@dataclass(frozen=True)
class Store:
    """The cells in `folder`/cells, each in `<recipe>-<budget>.json`; their times are in times.json."""

    folder: Path

    def cells(self) -> list[Cell]:
        """All finished cells, by recipe, in the table's order. Raises AdvpipeError for an invalid file."""
        order = [budget.name for budget in BUDGETS]
        found = [_read(path) for path in (self.folder / CELLS).glob("*.json")]
        return sorted(found, key=lambda cell: (cell.recipe, order.index(cell.budget)))

    def load(self, recipe: str, budget: str) -> Cell | None:
        """The cell; None if it is not finished."""
        path = self._path(recipe, budget)
        return _read(path) if path.is_file() else None

    def save(self, cell: Cell, times: Times) -> None:
        """Store a cell; a killed run leaves a whole file or none."""
        path = self._path(cell.recipe, cell.budget)
        path.parent.mkdir(parents=True, exist_ok=True)
        taken = {name: asdict(each) for name, each in (self.times() | {cell.name: times}).items()}
        text = json.dumps(taken, indent=1, sort_keys=True)
        write_atomically(self.folder / TIMES, f"{text}\n".encode())
        write_atomically(path, cell.to_json().encode())

    def times(self) -> dict[str, Times]:
        """The times of the cells by their names. Raises AdvpipeError for an invalid file."""
        path = self.folder / TIMES
        if not path.is_file():
            return {}
        try:
            stored = plain_json.load_json(path.read_bytes())
            return {name: Times(float(t["attack_s"]), float(t["evaluate_s"])) for name, t in stored.items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise AdvpipeError(f"{path} is damaged; remove it, no figure depends on it") from None

    def panels(self, recipe: str) -> Path:
        """The path of the picture of a recipe's four panels, which may not have been drawn."""
        return self.folder / "figures" / f"panels-{recipe}.png"

    def open(self, settings: Settings, recipes: Sequence[str], overwrite: bool) -> None:
        """Check that cells of these settings may be stored here; with `overwrite` others are removed.

        Recipes may differ in `OF_RECIPES`, cells of one recipe may not. Raises AdvpipeError for a
        folder that is no sweep's, and for cells of other settings.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise UsageError(f"{self.folder} is no folder; choose another {option_name('out')}")
        names = [path.name for path in self.folder.iterdir()] if self.folder.is_dir() else []
        strangers = [name for name in names if not is_leftover_name(name)]
        if strangers and not (self.folder / CELLS).is_dir():
            raise UsageError(
                f"{self.folder} holds {min(strangers)} but no {CELLS}/, so it is no sweep; "
                f"choose another {option_name('out')}"
            )
        for cell in self.cells():
            if (difference := _difference(cell, settings, cell.recipe in recipes)) is None:
                continue
            if not overwrite:
                key, theirs, ours = difference
                raise UsageError(
                    f"{self.folder} holds {cell.name} of another sweep ({key} {theirs}, not {ours}); give "
                    f"another {option_name('out')}, or pass {option_name('overwrite', True)} to remove what "
                    "does not fit"
                )
            self._path(cell.recipe, cell.budget).unlink()
            self.panels(cell.recipe).unlink(missing_ok=True)
        (self.folder / CELLS).mkdir(parents=True, exist_ok=True)

    def _path(self, recipe: str, budget: str) -> Path:
        return self.folder / CELLS / f"{recipe}-{budget}.json"


def _difference(cell: Cell, settings: Settings, is_asked_for: bool) -> tuple[str, object, object] | None:
    """Which setting differs first, with both values; `OF_RECIPES` count in recipes that are asked for."""
    mine, wanted = asdict(cell.settings), asdict(with_seed_of(cell.recipe, settings))
    for key, value in wanted.items():
        if mine[key] != value and (key not in OF_RECIPES or is_asked_for):
            return key.replace("code_sha256", "code of advpipe"), _short(mine[key]), _short(value)
    return None


def _short(value: object) -> str:
    text = str(value)
    return f"{text[:12]}…" if len(text) == 64 else text


def _read(path: Path) -> Cell:
    try:
        cell = Cell.from_json(path.read_text(encoding="utf-8"), path.parent)
        if path.stem != cell.name or cell.budget not in {budget.name for budget in BUDGETS}:
            raise ValueError(f"holds {cell.name}")
        return cell
    except (ValueError, KeyError, TypeError, AttributeError):
        raise AdvpipeError(
            f"{path} is damaged, or no cell of this version's sweeps; remove it to compute it again"
        ) from None
