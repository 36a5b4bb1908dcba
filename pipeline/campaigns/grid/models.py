"""The grid file: drives, attacks, detectors and defences, of which every combination is a cell."""

from __future__ import annotations

import json
from typing import Annotated, Any

from pydantic import Field, field_validator, model_validator

from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.section import Reference, Section
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.scenario.attacks import Attacks, BagName

DIALECT = "https://json-schema.org/draft/2020-12/schema"
SEED_KEY = "simulation.seed"
UNDEFENDED = "none"

IN_A_DATA_SET = ("clean", "scenario.yaml")
LONGEST_LABEL = 60
MOST_LEVELS, MOST_SEEDS, MOST_CELLS = 1000, 10_000, 100_000

Seed = Annotated[int, Field(strict=True, ge=0, lt=2**32)]
ScenarioSettings = Annotated[dict[Reference, Any], Field(max_length=1000)]
"""Values of scenario keys, each written `section.key`."""

Factor = (
    Annotated[list[Any], Field(min_length=1, max_length=MOST_LEVELS)]
    | Annotated[dict[Reference, ScenarioSettings], Field(min_length=1, max_length=MOST_LEVELS)]
)
"""What varies: values of the scenario key that is the factor's name, or settings by the level's name."""


class GridFile(Section):
    """A grid of experiments: each combination of factors and seeds is a drive; each attack, detector and
    defence on it is a cell."""

    name: BagName = Field(description="name of the grid, and of its folder")
    scenario: str = Field(min_length=1, max_length=4096, description="a shipped scenario, or a file")
    settings: ScenarioSettings = Field({}, description="scenario keys of all drives, section.key: value")
    factors: dict[Reference, Factor] = Field(
        {}, max_length=20, description="scenario keys with their values, or names with settings by level"
    )
    seeds: tuple[Seed, ...] = Field(
        (1,), min_length=1, max_length=MOST_SEEDS, description="seeds: one drive of each, for each level"
    )
    attacks: Attacks = Field(min_length=1, description="attacks by name, as in a scenario")
    detectors: tuple[str, ...] = Field(("small",), min_length=1, max_length=100)
    defences: tuple[Reference, ...] = Field(
        (UNDEFENDED,), min_length=1, max_length=100, description="none, or NAME[:parameters]"
    )
    frames: Reference = Field("::", description="start:stop:step of each drive that is attacked and scored")
    baseline_tries: int | None = Field(
        None,
        strict=True,
        ge=1,
        description="queries of the random baseline; by default those of the attack",
    )
    lidar: Reference | None = Field(None, description="topic of the clouds, among several LiDARs")

    @field_validator("seeds", "detectors", "defences")
    @classmethod
    def _distinct(cls, values: tuple[Any, ...]) -> tuple[Any, ...]:
        for value in values:
            if values.count(value) > 1:
                raise ValueError(f"{short_repr(value)} is given twice")
        return values

    @field_validator("frames")
    @classmethod
    def _frame_slice(cls, text: str) -> str:
        try:
            return str(FrameSlice.parse(text))
        except AdvpipeError as error:
            raise ValueError(str(error)) from None

    @model_validator(mode="after")
    def _consistent(self) -> GridFile:
        for factor in self.factors:
            labels = [label for label, _ in self.levels(factor)]
            for label in labels:
                if labels.count(label) > 1:
                    raise ValueError(f"factors.{factor}: level {short_repr(label)} is given twice")
        keys = {key for factor in self.factors for _, given in self.levels(factor) for key in given}
        if SEED_KEY in keys | self.settings.keys():
            raise ValueError(f"{SEED_KEY} is set by `seeds`; leave it out")
        for name, specs in self.attacks.items():
            if name in IN_A_DATA_SET:
                raise ValueError(f"attacks.{name}: the drive itself is named so; choose another name")
            if any(spec.frames != AttackOptions.frames for spec in specs):
                raise ValueError(f"attacks.{name}: give `frames` at the top of the grid, for all attacks")
        if self.cells > MOST_CELLS:
            raise ValueError(f"{self.cells} cells; at most {MOST_CELLS} are run")
        return self

    def levels(self, factor: str) -> list[tuple[Any, dict[str, Any]]]:
        """The levels of a factor: the label of each, a number or a text, and the scenario keys it sets."""
        given = self.factors[factor]
        if isinstance(given, dict):
            return list(given.items())
        return [(_label(value), {factor: value}) for value in given]

    @property
    def cells(self) -> int:
        """The number of cells."""
        count = len(self.seeds) * len(self.attacks) * len(self.detectors) * len(self.defences)
        for factor in self.factors:
            count *= len(self.factors[factor])
        return count


def _label(value: Any) -> float | int | str:
    """A value as tables show it: numbers stay numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        text = json.dumps(value, sort_keys=True, default=str)
        return text.replace('"', "")[:LONGEST_LABEL]
    return value[:LONGEST_LABEL] if isinstance(value, str) else value


def grid_schema_json() -> str:
    """The JSON Schema of grid files, an indented text."""
    schema = {"$schema": DIALECT, **GridFile.model_json_schema(), "title": "advpipe grid"}
    return json.dumps(schema, indent=2, ensure_ascii=False)
