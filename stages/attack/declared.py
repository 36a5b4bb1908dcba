"""What attacks with their parameters declare, for the bag that they make."""

from __future__ import annotations

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.plugins import mistakes_reported, plugin_names
from advpipe.pipeline.core.shown import shown
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.v2x.base import V2xAttack, v2x_traits


def declaration_of(spec: AttackSpec) -> Declaration:
    """The declaration of an attack. Raises AdvpipeError for a bad parameter, and for a class that declares
    what is none."""
    kind = find_attack(spec.type)
    if issubclass(kind, LidarAttack):
        return _of_clouds(spec, build_lidar_attack(spec))
    parameters = resolved_parameters(spec, kind)
    if not issubclass(kind, V2xAttack):
        return Declaration(family=kind.family)
    traits = v2x_traits(kind)
    with mistakes_reported(plugin_names([spec.type])):
        untrue = kind.untrue(parameters)
    if strange := sorted(set(untrue) - set(traits.untrue)):
        raise UsageError(f"{spec.type} makes {shown(strange[0])} untrue, which its traits do not tell")
    return Declaration(
        family=kind.family,
        every_message_matters=traits.every_message_matters,
        untrue=untrue,
        published=traits.published_with(parameters),
        parts=kind.parts(spec.type, parameters),
    )


def _of_clouds(spec: AttackSpec, attack: LidarAttack) -> Declaration:
    bounds: dict[str, tuple[float, float]] = {}
    with mistakes_reported(plugin_names([spec.type])):
        for name, (least, most) in attack.bounds.items():
            if name not in CLOUD_QUANTITIES:
                known = ", ".join(CLOUD_QUANTITIES)
                raise UsageError(f"{spec.type} bounds {shown(name)}, which nobody measures; known: {known}")
            bounds[name] = float(least), float(most)
    return Declaration(family=attack.family, bounds=bounds)
