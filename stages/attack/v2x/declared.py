"""The declaration of an attack on messages, from its class and parameters, without building the attack."""

from __future__ import annotations

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.base import checked_bounds
from advpipe.stages.attack.parameters import preset_class, preset_of, resolved_parameters
from advpipe.stages.attack.v2x.base import V2xAttack, v2x_traits


def declaration_of_messages(spec: AttackSpec, attack_class: type[V2xAttack]) -> Declaration:
    """The declaration of an attack of this class; raises AdvpipeError for an invalid one."""
    parameters, preset = resolved_parameters(spec, attack_class), preset_of(spec, attack_class)
    attack_class = preset_class(spec, attack_class)
    traits = v2x_traits(attack_class)
    untrue = attack_class.untrue(parameters)
    if undeclared := sorted(set(untrue) - set(traits.untrue)):
        raise UsageError(
            f"{spec.type} makes {short_repr(undeclared[0])} untrue, which its traits do not declare"
        )
    return Declaration(
        family=attack_class.family,
        bounds=checked_bounds(spec.type, attack_class, attack_class.bounds(parameters)),
        every_message_matters=traits.every_message_matters,
        labelled_as_published=preset is not None,
        untrue=untrue,
        begins_true=traits.begins_true,
        published=traits.published_with(parameters),
        parts=attack_class.parts(spec.type, parameters),
        message_types=traits.message_types,
    )
