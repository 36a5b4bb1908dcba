"""Variants of a recipe in a sweep: `best+twice` takes twice its steps, `best+hide` hides objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names

HIDE = "hide"
"""Minimises boxes of loose overlap; without it, an attack minimises boxes of strict overlap."""

STEPS: Mapping[str, float] = {"half": 0.5, "twice": 2}
"""Factors of the number of steps, to see whether more steps make the attack stronger."""

VARIANTS = (HIDE, *STEPS)


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
