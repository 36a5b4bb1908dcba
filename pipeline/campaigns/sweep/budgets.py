"""The budgets of the paper's tables, and the figures that it prints for them.

Anagnostopoulos et al., "Integrated Simulation Framework for Adversarial Attacks on Autonomous Vehicles",
arXiv 2509.05332: SECOND on 3,000 frames of CARLA's Town06. Its Table II has all budgets, its Table I three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from advpipe.pipeline.core.errors import UsageError


@dataclass(frozen=True)
class Axis:
    """What a budget bounds.

    parameter: of the attack. steps: its parameter that says how often it looks. unit: as the paper prints it.
    scale: the paper's number times this is the parameter. others: parameters that all budgets of the attack
    share.
    """

    title: str
    parameter: str
    steps: str
    unit: str
    scale: float = 1.0
    others: tuple[tuple[str, int], ...] = ()


AXES: dict[str, Axis] = {
    "perturb": Axis("Perturbation, ε in cm", "eps_cm", "steps", "cm"),
    "detach": Axis("Detachment, share removed in %", "ratio", "rounds", "%", scale=0.01),
    "attach": Axis("Attachment, ε in m", "eps_m", "rounds", "m", others=(("points", 300),)),
}


@dataclass(frozen=True)
class Budget:
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
        return {axis.parameter: round(self.printed * axis.scale, 9), **dict(axis.others)}


TABLES: dict[str, tuple[Budget, ...]] = {
    "paper": (
        Budget("perturb", 0.5, 99.85, 0.00010),
        Budget("perturb", 1.0, 98.77, 0.00025),
        Budget("perturb", 3.0, 93.28, 0.00182),
        Budget("perturb", 5.0, 89.07, 0.00466),
        Budget("perturb", 7.0, 82.79, 0.00842),
        Budget("perturb", 10.0, 73.20, 0.01533),
        Budget("detach", 0.05, 99.88, 0.00023),
        Budget("detach", 0.1, 97.44, 0.00117),
        Budget("detach", 0.3, 96.71, 0.00921),
        Budget("detach", 0.5, 95.28, 0.02177),
        Budget("detach", 1.0, 91.77, 0.07035),
        Budget("detach", 1.5, 88.75, 0.13397),
        Budget("attach", 0.05, 98.82, 0.00005),
        Budget("attach", 0.1, 95.19, 0.00011),
        Budget("attach", 0.3, 87.72, 0.00054),
        Budget("attach", 0.5, 78.46, 0.00126),
        Budget("attach", 0.7, 77.24, 0.00226),
        Budget("attach", 1.0, 77.09, 0.00429),
    )
}
"""Table II, in its order: mAP ratio in percent, Chamfer distance in m²."""

TABLE_ONE = ("perturb-10", "detach-1", "attach-0.5")
"""The budgets of Table I, in its order."""


def choose_budgets(table: str, names: Sequence[str] = ()) -> tuple[Budget, ...]:
    """The budgets of a table, or those that are named, in the table's order.

    Raises AdvpipeError for an unknown table or name, with the known ones.
    """
    if table not in TABLES:
        raise UsageError(f"unknown table {table!r}; known: {', '.join(TABLES)}")
    known = {budget.name: budget for budget in TABLES[table]}
    for name in names:
        if name not in known:
            raise UsageError(f"unknown cell {name!r}; known: {', '.join(known)}")
    return tuple(budget for name, budget in known.items() if not names or name in names)


def budget_named(name: str) -> Budget:
    """The budget of that name."""
    (budget,) = choose_budgets("paper", [name])
    return budget
