"""The budgets of the paper's tables, and the figures that it prints for them.

Anagnostopoulos et al., "Integrated Simulation Framework for Adversarial Attacks on Autonomous Vehicles",
arXiv 2509.05332: SECOND on 3,000 frames of CARLA's Town06. Its Table II has all budgets, its Table I three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.attack.lidar.base import Budget as Axis
from advpipe.stages.attack.lidar.base import lidar_traits
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS

AXES: Mapping[str, Axis] = {
    name: budget
    for name, attack_class in LIDAR_ATTACKS.items()
    if (budget := lidar_traits(attack_class).budget).published
}
"""By attack, what a budget of the paper's tables bounds; in the order of its Table II."""


@dataclass(frozen=True)
class SweepBudget:
    """One budget of an attack, and what the paper reports for it."""

    attack: str
    printed: float
    paper_map_ratio_percent: float
    paper_chamfer_distance_m2: float

    @property
    def name(self) -> str:
        """Such as `perturb-10`: the attack, and the number as the paper prints it."""
        return f"{self.attack}-{self.printed:g}"

    @property
    def title(self) -> str:
        """Such as `10 cm`."""
        return f"{self.printed:g} {AXES[self.attack].unit}"

    @property
    def parameters(self) -> dict[str, float | int]:
        """What the attack is given."""
        axis = AXES[self.attack]
        return {axis.parameter: round(self.printed * axis.scale, 9), **dict(axis.shared_parameters)}


TABLES: dict[str, tuple[SweepBudget, ...]] = {
    "paper": tuple(
        SweepBudget(attack, figure.table_value, figure.map_ratio_percent, figure.chamfer_distance_m2)
        for attack, axis in AXES.items()
        for figure in axis.published
    )
}
"""Table II, in its order: mAP ratio in percent, Chamfer distance in m²."""

_TEXT_DETACH_PERCENT = (0.1, 0.3, 0.5, 0.7, 1.0, 1.5)

TABLES["text"] = tuple(
    next(
        (each for each in TABLES["paper"] if (each.attack, each.printed) == ("detach", percent)),
        SweepBudget("detach", percent, nan, nan),
    )
    for percent in _TEXT_DETACH_PERCENT
)
"""The shares that detach removes by the paper's text (section IV-B); of 0.7 % it prints no figures."""

BUDGETS = tuple(
    sorted(
        {*TABLES["paper"], *TABLES["text"]}, key=lambda each: (list(AXES).index(each.attack), each.printed)
    )
)
"""All budgets, by attack from small to large."""

TABLE_ONE = tuple(
    budget.name
    for budget in TABLES["paper"]
    if budget.parameters[AXES[budget.attack].parameter] == AXES[budget.attack].default
)
"""The budgets of Table I, in its order: what an attack gets where the user names none."""


def choose_budgets(table: str, names: Sequence[str] = ()) -> tuple[SweepBudget, ...]:
    """The budgets of a table, or those that are named, in the table's order.

    Raises AdvpipeError for an unknown table or name, with the known ones.
    """
    if table not in TABLES:
        raise UsageError(f"unknown table {table!r}; {known_names(table, TABLES)}")
    known = {budget.name: budget for budget in TABLES[table]}
    for name in names:
        if name not in known:
            raise UsageError(f"unknown cell {name!r}; {known_names(name, known)}")
    return tuple(budget for name, budget in known.items() if not names or name in names)


def budget_named(name: str) -> SweepBudget:
    """The budget of that name."""
    known = {budget.name: budget for budget in BUDGETS}
    if name not in known:
        raise UsageError(f"unknown cell {name!r}; {known_names(name, known)}")
    return known[name]
