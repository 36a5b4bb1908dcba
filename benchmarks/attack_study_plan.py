"""What `attack_study.py` measures, in the order of importance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

from attack_cost import exact

from advpipe.pipeline.adversary import greedy_allocation
from advpipe.pipeline.campaigns.sweep.budgets import AXES, TABLE_ONE, budget_named
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.lidar.perturb import Perturb

FEW = ("perturb-3", "detach-0.3", "attach-0.1")
"""The smaller budgets at which convergence is asked for."""

STEPS: Mapping[str, float] = {"half": 0.5, "twice": 2.0, "four": 4.0}
PARAMETERS: Mapping[str, Mapping[str, Any]] = {
    "hide": {"goal": "hide"},
    "ray": {"along_ray": True},
    "order": {"keep_occlusion_order": True},
    "detections": {"truth": "detections"},
    "weighted": {"weight": 0.01},
    "ghost": {"ghost": "car:12:-6"},
}
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "decoys": {"decoys": True, "decoy_gradients": True},
    "no-decoy-gradients": {"decoys": True, "decoy_gradients": False},
    "no-decoys": {"decoys": False, "decoy_gradients": False},
    "patience": {"patience": 4},
}
"""Of `perturb` alone: what false detections are good for, and restarts of single objects."""

EXACT, NO_LINE_SEARCH = "exact", "no-line-search"
"""All of each cloud is shown, and all of its map computed; lost objects keep all of their points."""

VARIANTS = (*STEPS, *PARAMETERS, *SETTINGS, EXACT, NO_LINE_SEARCH)


@dataclass(frozen=True)
class Condition:
    """Clouds under an attack, or the clean ones (`CLEAN`).

    budget: such as perturb-10. variants: some of `VARIANTS`. is_defended: the defences are scored, too;
    is_checked: attack checks judge the clouds.
    """

    budget: str
    recipe: str
    variants: tuple[str, ...] = ()
    seed: int = 0
    is_defended: bool = False
    is_checked: bool = False

    @property
    def label(self) -> str:
        """Without the seed."""
        return "/".join([self.budget, "+".join([self.recipe, *self.variants])])

    @property
    def key(self) -> str:
        return f"{self.label}/{self.seed}"

    @property
    def attack(self) -> str:
        """The type of the attack."""
        return self.budget.partition("-")[0]

    def build(self) -> LidarAttack:
        """The attack. Raises UsageError for a variant that it does not know."""
        budget = budget_named(self.budget)
        parameters: dict[str, Any] = {**budget.parameters}
        for variant in self.variants:
            if variant not in VARIANTS:
                raise UsageError(f"unknown variant {variant!r}; known: {', '.join(VARIANTS)}")
            parameters |= PARAMETERS.get(variant, {})
        if factor := next((STEPS[each] for each in self.variants if each in STEPS), 0):
            steps = AXES[budget.attack].steps
            usual = getattr(_built(budget.attack, self.recipe, parameters), steps)
            parameters[steps] = max(1, round(factor * usual))
        attack = _built(budget.attack, self.recipe, parameters)
        for variant in self.variants:
            if variant in SETTINGS:
                if not isinstance(attack, Perturb):
                    raise UsageError(f"variant {variant} is of perturb alone")
                attack.settings = replace(attack.settings, **SETTINGS[variant])
        return attack

    def setting(self) -> AbstractContextManager[None]:
        """What holds while the attack runs."""
        if NO_LINE_SEARCH in self.variants:
            return no_line_search()
        return exact() if EXACT in self.variants else nullcontext()


@contextmanager
def no_line_search() -> Iterator[None]:
    with patch.object(greedy_allocation, "LINE_SEARCH", 0):
        yield


CLEAN = Condition("clean", "clean", is_defended=True, is_checked=True)


def plan(seeds: int = 2) -> list[Condition]:
    """All conditions, the most important first. seeds: of how many the main recipes are measured."""

    def each(
        budgets: Iterable[str], recipe: str, *variants: str, seed: int = 0, **shown: bool
    ) -> list[Condition]:
        return [Condition(budget, recipe, variants, seed, **shown) for budget in budgets]

    choosing = ("detach-1", "attach-0.5", "detach-0.3", "attach-0.1")
    table, perturb, moving = TABLE_ONE, ("perturb-10",), ("perturb-10", "attach-0.5")
    others = [
        *each(table, "hide"),
        *each(perturb, "best", "no-decoys"),
        *each(table, "best", "twice"),
        *each(perturb, "best", "no-decoy-gradients"),
        *each(perturb, "best", "no-decoys", "twice"),
        *each(("perturb-10", "perturb-3"), "best", "patience"),
        *each(("perturb-10", "perturb-3"), "best", "no-decoys", "patience"),
        *each(table, "robust", is_defended=True),
        *each(table, "stealthy", is_checked=True),
        *each(table, "random-best", "hide"),
        *each(FEW, "best"),
        *each(FEW, "random-best"),
        *each(FEW, "best", "twice"),
        *each(choosing, "best", NO_LINE_SEARCH),
        *each(("attach-0.5",), "best", "ghost", is_checked=True),
        *each(perturb, "best", "no-decoy-gradients", "half"),
        *each(("perturb-3",), "best", "no-decoy-gradients"),
        *each(("perturb-3",), "best", "no-decoys"),
        *each(("perturb-3",), "best", "no-decoys", "twice"),
    ]
    last = [
        *each(table, "best", EXACT),
        *each(table, "paper"),
        *each(moving, "paper", "weighted"),
        *each((*table, *FEW), "best", "half"),
        *each(table, "best", "detections"),
        *each(moving, "best", "ray"),
        *each(moving, "best", "order"),
        *each((*table, *FEW), "best", "four"),
    ]
    main = [
        *each(table, "best", is_defended=True, is_checked=True),
        *each(table, "random-best", is_defended=True, is_checked=True),
    ]
    again = [replace(one, seed=seed) for seed in range(1, seeds) for one in (*main, *others[:3])]
    return [CLEAN, *main, *others, *again, *last]


def chosen(conditions: Iterable[Condition], only: Iterable[str]) -> list[Condition]:
    """The conditions with one of these texts in their key, in the order of the texts; all without any. The
    clean clouds stay, as every ratio needs them. Raises UsageError for a text that is in none."""
    every, kept = list(conditions), [CLEAN]
    for text in only:
        found = [one for one in every if text in one.key]
        if not found:
            raise UsageError(f"--only {text}: no condition has this in its name, such as {every[1].key}")
        kept += [one for one in found if one not in kept]
    return kept if len(kept) > 1 else every


def _built(attack: str, recipe: str, parameters: Mapping[str, Any]) -> LidarAttack:
    return build_lidar_attack(attack_spec({"type": attack, "recipe": recipe, "parameters": dict(parameters)}))
