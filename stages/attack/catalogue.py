"""The attacks as users choose among them: the properties that their classes and defaults declare."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from typing import Any, get_args

from advpipe.pipeline.labels.declaration import Declaration, Family
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.base import Attack, Traits
from advpipe.stages.attack.declared import declaration_of
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, lidar_traits
from advpipe.stages.attack.parameter_docs import Parameter, documented_parameters, recipe_text, summary
from advpipe.stages.attack.parameters import REQUIRED
from advpipe.stages.attack.registry import ATTACKS, default_budget, find_attack, resolved_name


@dataclass(frozen=True)
class BoundText:
    """A limit that an attack declares and `verify` measures. unit: "1" of counts and shares."""

    quantity: str
    meaning: str
    unit: str
    least: float
    most: float

    def __str__(self) -> str:
        limits = f"{self.least:g} to {self.most:g}" if self.least < self.most else f"{self.most:g}"
        return limits if self.unit == "1" else f"{limits} {self.unit}"


@dataclass(frozen=True)
class CatalogueEntry:
    """One attack.

    family_title, usual_options: see `Attack`. budget: the parameter that bounds the change, and budget_title
    what that is, with the unit of tables; both "" where no single one does. budget_default, budget_published:
    of the parameter, and its least and most in the paper. recipe: how a LiDAR attack may
    search; "" of others. parameters: with the defaults of the command line. bounds, untrue: what it declares
    with these defaults: limits, and what its messages claim falsely; nothing where a parameter has to be
    given first.
    """

    name: str
    family: Family
    family_title: str
    usual_options: str
    summary: str
    also_known_as: tuple[str, ...]
    budget: str
    budget_title: str
    budget_default: float | None
    budget_published: tuple[float, ...]
    recipe: str
    parameters: tuple[Parameter, ...]
    bounds: tuple[BoundText, ...]
    untrue: tuple[str, ...]

    @property
    def headline(self) -> str:
        """The first sentence of the summary."""
        return re.split(r"(?<=[a-z0-9)])\.\s(?=[A-Z])", self.summary, maxsplit=1)[0].removesuffix(".") + "."

    def plain(self) -> dict[str, Any]:
        """For programs: types by their names, and `null` for the default of a parameter that has none."""
        parameters = [
            {
                "name": one.name,
                "types": [each.__name__ for each in one.types],
                "is_required": one.default is REQUIRED,
                "default": None if one.default is REQUIRED else one.default,
                "help": one.help,
            }
            for one in self.parameters
        ]
        return {**asdict(self), "parameters": parameters}


FAMILIES: tuple[Family, ...] = get_args(Family)


def catalogue(family: Family | None = None) -> tuple[CatalogueEntry, ...]:
    """All registered attacks, family by family; or those of one."""
    chosen = [name for name, kind in ATTACKS.items() if family in (None, kind.family)]
    return tuple(map(catalogue_entry, chosen))


def catalogue_entry(attack: str) -> CatalogueEntry:
    """An attack by its own name, by that of a paper, or by `module:Class`; raises AdvpipeError for none."""
    name = resolved_name(attack_spec({"type": attack})).type
    attack_class, usual = find_attack(name), default_budget(name)
    budget = lidar_traits(attack_class).budget if issubclass(attack_class, LidarAttack) else None
    parameters = tuple(
        Parameter(one.name, one.types, usual.get(one.name, one.default), one.help)
        for one in documented_parameters(attack_class)
    )
    can_be_built = all(one.default is not REQUIRED for one in parameters)
    spec = attack_spec({"type": name, "parameters": usual})
    declared = declaration_of(spec) if can_be_built else Declaration(family=attack_class.family)
    traits: Traits = vars(attack_class)["traits"]
    return CatalogueEntry(
        name=name,
        family=attack_class.family,
        family_title=attack_class.family_title,
        usual_options=attack_class.usual_options,
        summary=summary(attack_class),
        also_known_as=traits.also_known_as,
        budget=budget.parameter if budget else "",
        budget_title=budget.title if budget else "",
        budget_default=budget.default if budget else None,
        budget_published=_published_range(budget) if budget else (),
        recipe=recipe_text(attack_class),
        parameters=parameters,
        bounds=tuple(_bound_text(attack_class, each, *limits) for each, limits in declared.bounds.items()),
        untrue=declared.untrue,
    )


def _published_range(budget: Budget) -> tuple[float, ...]:
    values = [figure.table_value * budget.scale for figure in budget.published]
    return (min(values), max(values)) if values else ()


def _bound_text(attack_class: type[Attack], name: str, least: float, most: float) -> BoundText:
    quantity = attack_class.quantities[name]
    return BoundText(name, quantity.meaning, quantity.unit, least, most)
