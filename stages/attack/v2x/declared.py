"""What an attack on messages declares: from its class and parameters, as it is made for a drive alone."""

from __future__ import annotations

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.base import checked_bounds
from advpipe.stages.attack.parameters import resolved_parameters
from advpipe.stages.attack.v2x.base import V2xAttack, v2x_traits


def declaration_of_messages(spec: AttackSpec, kind: type[V2xAttack]) -> Declaration:
    """The declaration of an attack of this class; raises AdvpipeError for what is none."""
    parameters, traits = resolved_parameters(spec, kind), v2x_traits(kind)
    untrue = kind.untrue(parameters)
    if strange := sorted(set(untrue) - set(traits.untrue)):
        raise UsageError(f"{spec.type} makes {short_repr(strange[0])} untrue, which its traits do not tell")
    return Declaration(
        family=kind.family,
        bounds=checked_bounds(spec.type, kind, kind.bounds(parameters)),
        every_message_matters=traits.every_message_matters,
        untrue=untrue,
        published=traits.published_with(parameters),
        parts=kind.parts(spec.type, parameters),
    )
