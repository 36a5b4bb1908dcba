"""Variants of a recipe in a sweep: `best+twice` looks twice as often as `best`, `best+hide` hides objects."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.evaluate.sweep.cell import Cell

TWICE = "twice"
"""Twice the steps by the same rule: what changes little by them has converged."""

HIDE = "hide"
"""After no box at all, rather than after boxes that are off."""

VARIANTS = (HIDE, TWICE)


def split_recipe(word: str) -> tuple[str, tuple[str, ...]]:
    """The recipe and its variants; AdvpipeError for a variant that is none, and for a second spelling."""
    recipe, *variants = word.split("+")
    for variant in variants:
        if variant not in VARIANTS:
            raise AdvpipeError(
                f"unknown variant {variant!r} of recipe {recipe}; known: {', '.join(VARIANTS)}"
            )
    spelling = "+".join([recipe, *(variant for variant in VARIANTS if variant in variants)])
    if word != spelling:
        raise AdvpipeError(f"recipe {word} is spelt {spelling}")
    return recipe, tuple(variants)


def is_twice(recipe: str) -> bool:
    """Whether a recipe's word asks for twice the steps."""
    return TWICE in split_recipe(recipe)[1]


def pairs_of_twice(cells: Sequence[Cell]) -> list[tuple[Cell, Cell]]:
    """The cells that were also run with twice the steps, each with that one."""
    found = {(cell.recipe, cell.budget): cell for cell in cells}
    pairs = []
    for doubled in (cell for cell in cells if is_twice(cell.recipe)):
        recipe, variants = split_recipe(doubled.recipe)
        once = "+".join([recipe, *(variant for variant in variants if variant != TWICE)])
        if (once, doubled.budget) in found:
            pairs.append((found[once, doubled.budget], doubled))
    return pairs
