"""Builds attacks on messages from their specifications."""

from __future__ import annotations

from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.parameters import PRESET, preset_class, preset_of, resolved_parameters
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack


def build_attack(spec: AttackSpec, attack_class: type[V2xAttack], context: AttackContext) -> V2xAttack:
    """The attack, carried out by the class of its preset, if it names one. Raises AdvpipeError for invalid
    parameters."""
    preset, parameters = preset_of(spec, attack_class), resolved_parameters(spec, attack_class)
    if preset is not None:
        del parameters[PRESET]
    attack = preset_class(spec, attack_class)(context, **parameters)
    attack.preset = preset
    return attack
