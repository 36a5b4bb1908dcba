"""Attacks on clouds with their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.base import LidarAttack, lidar_traits
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.parameters import known_parameters, resolved_parameters, resolved_recipe


def build_lidar_attack(spec: AttackSpec) -> LidarAttack:
    """The attack, its parameters checked; raises `AdvpipeError` for a bad one."""
    kind = LIDAR_ATTACKS.find(spec.type)
    recipe, keywords = resolved_recipe(spec, kind), dict(resolved_parameters(spec, kind))
    if recipe:
        _refuse_unused(spec, kind, recipe, keywords)
        keywords["recipe"] = recipe
    with plugin_errors(plugin_names([spec.type])):
        return kind(**keywords)


def query_budget_of(attack: LidarAttack) -> int | None:
    """The attack's `query_budget`; raises AdvpipeError where a user's attack gives no count."""
    queries = attack.query_budget
    if queries is not None and not (isinstance(queries, int) and queries >= 1):
        name = type(attack).__name__
        raise UsageError(f"{name}: query_budget is {queries!r}, but must be a whole number from 1 up")
    return queries


def _refuse_unused(
    spec: AttackSpec, kind: type[LidarAttack], recipe: str, parameters: Mapping[str, Any]
) -> None:
    """Raises AdvpipeError for a parameter that its recipe would pass over in silence."""
    usual = known_parameters(kind)
    for name, recipes in lidar_traits(kind).only_for.items():
        if name in usual and parameters[name] != usual[name] and recipe not in recipes:
            raise UsageError(
                f"{spec.type}: recipe {recipe} does not look at {name}; leave it out, or take one that does: "
                f"{', '.join(recipes)}"
            )
