"""Build attacks on clouds from their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.base import LidarAttack, lidar_traits
from advpipe.stages.attack.lidar.registry import LIDAR_ATTACKS
from advpipe.stages.attack.parameters import known_parameters, resolved_parameters, resolved_recipe


def build_lidar_attack(spec: AttackSpec) -> LidarAttack:
    """The attack with checked parameters. Raises AdvpipeError for a bad one."""
    attack_class = LIDAR_ATTACKS.find(spec.type)
    recipe, keywords = resolved_recipe(spec, attack_class), dict(resolved_parameters(spec, attack_class))
    if recipe:
        _refuse_unused(spec, attack_class, recipe, keywords)
        keywords["recipe"] = recipe
    with plugin_errors(plugin_names([spec.type])):
        return attack_class(**keywords)


def adaptation_of(spec: AttackSpec) -> Adaptation:
    """How the attack's clouds are presented to its detector."""
    return Adaptation(spec.lidar_height_m, spec.level, spec.scale_intensity)


def count_of(attack: LidarAttack, name: str) -> int | None:
    """The attack's `query_budget` or `baseline_tries`; raises AdvpipeError if a user's attack gives anything
    but a count."""
    count = getattr(attack, name)
    if count is not None and not (isinstance(count, int) and count >= 1):
        kind = type(attack).__name__
        raise UsageError(f"{kind}: {name} is {count!r}, but must be a whole number from 1 up")
    return count


def _refuse_unused(
    spec: AttackSpec, attack_class: type[LidarAttack], recipe: str, parameters: Mapping[str, Any]
) -> None:
    """Raises AdvpipeError for a parameter that the recipe would silently ignore."""
    defaults = known_parameters(attack_class)
    for name, recipes in lidar_traits(attack_class).only_for.items():
        if name in defaults and parameters[name] != defaults[name] and recipe not in recipes:
            raise UsageError(
                f"{spec.type}: recipe {recipe} does not use {name}; leave it out, or take one that does: "
                f"{', '.join(recipes)}"
            )
