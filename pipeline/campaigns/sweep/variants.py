"""Variants of a recipe in a sweep: `best+twice` takes twice its steps, `best+ray` keeps points on rays,
`best+seed1` has another seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
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

SEEDS: Mapping[str, int] = {f"seed{more}": more for more in range(1, 10)}
"""By how much the seed of the attack, the baselines and the bootstrap is above the sweep's."""

VARIANTS = (*PARAMETERS, *STEPS, *SEEDS)


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
    for what, among in (("numbers of steps", STEPS), ("seeds", SEEDS)):
        if len([variant for variant in variants if variant in among]) > 1:
            raise UsageError(f"recipe {text} asks for two {what}; take one of {', '.join(among)}")
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


def seed_above(recipe: str) -> int:
    """By how much the seed of a recipe is above the sweep's."""
    return next((SEEDS[variant] for variant in split_recipe(recipe)[1] if variant in SEEDS), 0)


def with_seed_of(recipe: str, settings: Settings) -> Settings:
    """The settings of a cell of a recipe, given the sweep's."""
    return replace(settings, seed=settings.seed + seed_above(recipe))


def with_seeds(recipes: Sequence[str], count: int) -> tuple[str, ...]:
    """The recipes, each with so many seeds; those that name one keep it.

    Raises AdvpipeError for more seeds than variants name.
    """
    if count - 1 > len(SEEDS):
        raise UsageError(f"seeds is {count}, but a sweep takes at most {len(SEEDS) + 1}")
    named = [
        f"{recipe}+seed{more}" if more else recipe
        for recipe in recipes
        for more in range(1 if seed_above(recipe) else count)
    ]
    return tuple(dict.fromkeys(named))


def by_steps(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """The cells that were also run with other steps, by the name of the plain one, from few steps to many.

    Cells without a plain one are left out: there is nothing to compare them with.
    """
    families = _families(cells, STEPS)
    return {
        name: sorted(family, key=lambda cell: steps_factor(cell.recipe))
        for name, family in families.items()
        if any(cell.name == name for cell in family)
    }


def by_seeds(cells: Sequence[Cell]) -> dict[str, list[Cell]]:
    """The cells that were also run with other seeds, by the name without one, in the order of the seeds."""
    families = _families(cells, SEEDS)
    return {
        name: sorted(family, key=lambda cell: seed_above(cell.recipe)) for name, family in families.items()
    }


def _families(cells: Sequence[Cell], among: Mapping[str, float]) -> dict[str, list[Cell]]:
    """Cells that differ in these variants alone, by the name without them; two or more of each."""
    families: dict[str, list[Cell]] = {}
    for cell in cells:
        recipe, variants = split_recipe(cell.recipe)
        plain = "+".join([recipe, *(variant for variant in variants if variant not in among)])
        families.setdefault(f"{plain}-{cell.budget}", []).append(cell)
    return {name: family for name, family in families.items() if len(family) > 1}
