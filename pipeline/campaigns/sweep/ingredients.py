"""What each ingredient of recipe `best` brings, as benchmarks/ingredients.py measured it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from advpipe.pipeline.campaigns.sweep.budgets import AXES
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.core import plain_json
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Table

PATH = Path(__file__).with_name("ingredients.json")

COLUMNS: dict[str, tuple[str, int]] = {
    "map_ratio_plain_percent": ("mAP ratio %", 1),
    "map_ratio_loose_percent": ("at loose overlap %", 1),
    "map_ratio_jitter_percent": ("after 1 cm of jitter %", 1),
    "map_ratio_rounding_percent": ("rounded to 1 cm %", 1),
    "car_ratio_percent": ("cars %", 1),
    "chamfer_distance_m2": ("CD m²", 5),
    "s_per_frame": ("s a frame", 0),
}
"""Of each figure that is shown, its head and digits."""


def measured(cells: Sequence[Cell]) -> dict[str, Any]:
    """By attack, what was measured with the detector of these cells; empty for other detectors."""
    stored: dict[str, Any] = plain_json.load_json(PATH.read_text(encoding="utf-8"))
    detectors = {cell.settings.detector_sha256 for cell in cells}
    return {
        attack: stored[attack]
        for attack in AXES
        if attack in stored and stored[attack]["detector_sha256"] in detectors
    }


def lines_of(about: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """What was measured of an attack, by the line's name."""
    return {line["line"]: line for line in about["lines"]}


def ingredients_tables(cells: Sequence[Cell]) -> list[Table]:
    """A table for each attack: a line for the recipe, and one for each thing that was changed of it."""
    return [
        Table(
            f"What each ingredient brings: {attack}, {_after_comma(attack)} {about['lines'][0]['budget']:g}, "
            f"{len(about['frame_list'])} frames of a validation drive",
            ("recipe best, but", *(head for head, _ in COLUMNS.values())),
            tuple(
                (line["line"], *(formatted_number(line[key], digits) for key, (_, digits) in COLUMNS.items()))
                for line in about["lines"]
            ),
        )
        for attack, about in measured(cells).items()
    ]


def _after_comma(attack: str) -> str:
    """Such as `share removed in %`."""
    return AXES[attack].title.partition(", ")[2]
