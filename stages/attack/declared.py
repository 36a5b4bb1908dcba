"""What attacks declare, with their parameters, in the bag that they make."""

from __future__ import annotations

from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.base import checked_bounds
from advpipe.stages.attack.camera.base import CameraAttack
from advpipe.stages.attack.gnss.base import GnssAttack
from advpipe.stages.attack.lidar.base import LidarAttack, lidar_traits
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.radar.base import RadarAttack
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.v2x.base import V2xAttack
from advpipe.stages.attack.v2x.declared import declaration_of_messages


def declaration_of(spec: AttackSpec) -> Declaration:
    """The declaration of an attack. Raises AdvpipeError for a bad parameter, and for a class whose
    declaration is invalid."""
    attack_class = find_attack(spec.type)
    with plugin_errors(plugin_names([spec.type])):
        if issubclass(attack_class, V2xAttack):
            return declaration_of_messages(spec, attack_class)
        if issubclass(attack_class, LidarAttack):
            bounds = checked_bounds(spec.type, attack_class, build_lidar_attack(spec).bounds)
            own = tuple(each for each in lidar_traits(attack_class).quantities if each.name in bounds)
            return Declaration(family=attack_class.family, bounds=bounds, quantities=own)
        assert issubclass(attack_class, (GnssAttack, RadarAttack, CameraAttack))
        bounds = checked_bounds(
            spec.type, attack_class, attack_class(**resolved_parameters(spec, attack_class)).bounds
        )
        return Declaration(family=attack_class.family, bounds=bounds)
