"""Loads a grid file and the scenario of each of its drives; every mistake is found before the first drive."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from advpipe.pipeline.campaigns.grid.models import SEED_KEY, UNDEFENDED, GridFile
from advpipe.pipeline.campaigns.run import mistakes_of_attacks
from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, as_usage_error
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.scenario import Scenario, dump_scenario, load_scenario
from advpipe.pipeline.scenario.document import DocumentError, ScenarioText, read_document
from advpipe.pipeline.scenario.mistake import Mistake
from advpipe.pipeline.scenario.mistakes import mistakes_line, schema_mistakes

Levels = Mapping[str, Any]
"""By factor, the label of its level: a number or a text."""


@dataclass(frozen=True)
class GridDrive:
    """A drive of the grid: a level of each factor, and a seed."""

    levels: Levels
    seed: int
    scenario: Scenario

    @property
    def id(self) -> str:
        """Such as `seed3-0f8a2c44`: the same for the same resolved scenario."""
        return f"seed{self.seed}-{hashlib.sha256(dump_scenario(self.scenario).encode()).hexdigest()[:12]}"

    @property
    def title(self) -> str:
        """Its id, and its levels where the grid has factors, as errors name it."""
        return f"{self.id} ({_spelt(self.levels)})" if self.levels else self.id


@dataclass(frozen=True)
class LoadedGrid:
    """A grid file without mistakes, and its drives: by levels, then by seeds."""

    file: GridFile
    drives: tuple[GridDrive, ...]


def load_grid(path: Path) -> LoadedGrid:
    """Load a grid file. Raises UsageError, one line with all mistakes that are found together."""
    with as_usage_error():
        document = _read(path)
        grid = _validated(path, document)
        if mistakes := [*_further_mistakes(grid)]:
            raise UsageError(mistakes_line(mistakes, path, document, ()))
        drives = tuple(_drives(path, grid))
        ids = [drive.id for drive in drives]
        for place, drive in enumerate(drives):
            if drive.id in ids[:place]:
                same = drives[ids.index(drive.id)]
                raise UsageError(
                    f"{path}: levels {_spelt(drive.levels)} and {_spelt(same.levels)} are the same drive; "
                    "leave one out"
                )
    return LoadedGrid(grid, drives)


def _read(path: Path) -> ScenarioText:
    try:
        document = read_document(read_text(path))
    except DocumentError as error:
        where = f" line {error.line}" if error.line else ""
        raise UsageError(f"{path}{where}: {error}") from None
    if not isinstance(document.tree, dict):
        raise UsageError(f"{path} holds no grid: expected `name:`, `scenario:`, ... at the top level")
    return document


def _validated(path: Path, document: ScenarioText) -> GridFile:
    try:
        return GridFile.model_validate(document.tree)
    except ValidationError as error:
        raise UsageError(mistakes_line([*schema_mistakes(error, GridFile)], path, document, ())) from None


def _further_mistakes(grid: GridFile) -> Iterator[Mistake]:
    """What the schema cannot know: unknown attacks, parameters and defences."""
    for name, specs in grid.attacks.items():
        for number, text in mistakes_of_attacks(specs, None):
            yield ("attacks", name, *(() if number is None else (str(number),))), text
    for number, defence in enumerate(grid.defences):
        if defence == UNDEFENDED:
            continue
        try:
            if len(parse_defences((defence,))) != 1:
                yield ("defences", str(number)), f"{short_repr(defence)} is not one defence; name each"
        except AdvpipeError as error:
            yield ("defences", str(number)), str(error)


def _drives(path: Path, grid: GridFile) -> Iterator[GridDrive]:
    beside = path.parent / grid.scenario
    scenario = str(beside) if beside.is_file() else grid.scenario
    for chosen in product(*(grid.levels(factor) for factor in grid.factors)):
        levels = dict(zip(grid.factors, (label for label, _ in chosen), strict=True))
        settings = dict(grid.settings)
        for _, keys in chosen:
            settings |= keys
        for seed in grid.seeds:
            try:
                loaded = load_scenario(scenario, {**settings, SEED_KEY: seed})
            except AdvpipeError as error:
                where = f" ({_spelt(levels)})" if levels else ""
                raise UsageError(f"{path}{where}: {error}") from None
            yield GridDrive(levels, seed, loaded.model_copy(update={"attacks": {}}))


def _spelt(levels: Levels) -> str:
    return ", ".join(f"{factor} = {label}" for factor, label in levels.items()) or "none"
