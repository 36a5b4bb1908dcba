"""Variants of a recipe in a sweep: `best+twice` takes twice its steps, `best+ray` keeps points on rays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.parameters import known_parameters

PARAMETERS: Mapping[str, Mapping[str, Any]] = {
    "hide": {"goal": "hide"},
    "ray": {"along_ray": True},
    "order": {"keep_occlusion_order": True},
    "detections": {"truth": "detections"},
    "weighted": {"weight": 0.01},
}
"""What a variant gives the attack: to minimise boxes of loose overlap, not of strict; to keep points on their
rays, or in front of what they hide; to know the clean detections, not the true boxes; the paper's λ."""

STEPS: Mapping[str, float] = {"half": 0.5, "twice": 2}
"""Factors of the number of steps, to see whether more steps make the attack stronger."""

VARIANTS = (*PARAMETERS, *STEPS)


def split_recipe(text: str) -> tuple[str, tuple[str, ...]]:
    """The recipe and its variants. Raises AdvpipeError for an unknown variant or another spelling."""
    recipe, *variants = text.split("+")
    for variant in variants:
        if variant not in VARIANTS:
            raise UsageError(
                f"unknown variant {variant!r} of recipe {recipe}; {known_names(variant, VARIANTS)}"
            )
    spelling = "+".join([recipe, *(variant for variant in VARIANTS if variant in variants)])
    if text != spelling:
        raise UsageError(f"recipe {text} is spelt {spelling}")
    if len([variant for variant in variants if variant in STEPS]) > 1:
        raise UsageError(f"recipe {text} asks for two numbers of steps; take one of {', '.join(STEPS)}")
    return recipe, tuple(variants)


def variant_parameters(recipe: str, attack: str) -> dict[str, Any] | None:
    """What the variants of a recipe give an attack; None where it has no such parameter, as `detach`, which
    moves no point, has no `along_ray`."""
    found: dict[str, Any] = {}
    for variant in split_recipe(recipe)[1]:
        found |= PARAMETERS.get(variant, {})
    return found if found.keys() <= known_parameters(LIDAR_ATTACKS.find(attack)).keys() else None


def steps_factor(recipe: str) -> float:
    """The number of steps of a recipe over that of the plain recipe."""
    return next((STEPS[variant] for variant in split_recipe(recipe)[1] if variant in STEPS), 1)


def by_steps(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """The cells that were also run with other steps, by the name of the plain one, from few steps to many.

    Cells without a plain one are left out: there is nothing to compare them with.
    """
    families: dict[str, list[Cell]] = {}
    for cell in cells:
        recipe, variants = split_recipe(cell.recipe)
        plain = "+".join([recipe, *(variant for variant in variants if variant not in STEPS)])
        families.setdefault(f"{plain}-{cell.budget}", []).append(cell)
    return {
        name: sorted(family, key=lambda cell: steps_factor(cell.recipe))
        for name, family in families.items()
        if len(family) > 1 and any(cell.name == name for cell in family)
    }
