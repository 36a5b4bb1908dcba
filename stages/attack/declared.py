"""What attacks with their parameters declare, for the bag that they make."""

from __future__ import annotations

import math
from collections.abc import Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.plugins import mistakes_reported, plugin_names
from advpipe.pipeline.core.shown import shown
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.base import Attack
from advpipe.stages.attack.gnss.base import GnssAttack
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.v2x.base import V2xAttack, v2x_traits


def declaration_of(spec: AttackSpec) -> Declaration:
    """The declaration of an attack. Raises AdvpipeError for a bad parameter, and for a class that declares
    what is none."""
    kind = find_attack(spec.type)
    with mistakes_reported(plugin_names([spec.type])):
        if issubclass(kind, V2xAttack):
            return _of_messages(spec, kind)
        if issubclass(kind, LidarAttack):
            bounds = build_lidar_attack(spec).bounds
        else:
            assert issubclass(kind, GnssAttack)
            bounds = kind(**resolved_parameters(spec, kind)).bounds
        return Declaration(family=kind.family, bounds=_checked(spec.type, kind, bounds))


def _of_messages(spec: AttackSpec, kind: type[V2xAttack]) -> Declaration:
    """Of an attack that is made once there is a drive: from its class alone."""
    parameters, traits = resolved_parameters(spec, kind), v2x_traits(kind)
    untrue = kind.untrue(parameters)
    if strange := sorted(set(untrue) - set(traits.untrue)):
        raise UsageError(f"{spec.type} makes {shown(strange[0])} untrue, which its traits do not tell")
    return Declaration(
        family=kind.family,
        bounds=_checked(spec.type, kind, kind.bounds(parameters)),
        every_message_matters=traits.every_message_matters,
        untrue=untrue,
        published=traits.published_with(parameters),
        parts=kind.parts(spec.type, parameters),
    )


def _checked(
    attack: str, kind: type[Attack], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """The bounds as numbers. Raises AdvpipeError for a quantity that nobody measures, and for one that is not
    finite."""
    checked = {}
    for name, (least, most) in bounds.items():
        if name not in kind.quantities:
            known = ", ".join(kind.quantities)
            raise UsageError(f"{attack} bounds {shown(name)}, which nobody measures; known: {known}")
        if not math.isfinite(float(least) - float(most)):
            raise UsageError(f"{attack} bounds {name} by {least} to {most}, which are no finite numbers")
        checked[name] = float(least), float(most)
    return checked
