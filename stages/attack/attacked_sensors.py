"""The sensors of one kind that an attack acts on, of those that a bag holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.base import Attack
from advpipe.stages.attack.parameters import resolved_parameters


class RecordedSensor(Protocol):
    """A sensor in a bag: its vehicle, and its name there."""

    @property
    def vehicle(self) -> str: ...

    @property
    def name(self) -> str: ...


S = TypeVar("S", bound=RecordedSensor)


def attacked_sensors(
    bag: str, spec: AttackSpec, attack_class: type[Attack], sensors: Sequence[S], kind: str, topic: str
) -> list[S]:
    """Those of the victim, or the one that the attack's parameter `kind` names.

    Without a victim in `spec`, it is the only vehicle with such sensors, or `ego`. kind: `camera` or `radar`.
    topic: of which topics they are known, for the error. Raises UsageError where there is none.
    """
    vehicles = sorted({one.vehicle for one in sensors})
    if not vehicles:
        raise UsageError(f"{spec.type}: {bag} has no {kind} (no topic of {topic})")
    victim = spec.victim or (vehicles[0] if len(vehicles) == 1 else "ego")
    own = [one for one in sensors if one.vehicle == victim]
    if not own:
        known = known_names(victim, vehicles, f"those with {kind}s")
        raise UsageError(f"{spec.type}: {victim} has no {kind} in {bag}; {known}")
    name = resolved_parameters(spec, attack_class).get(kind, "")
    chosen = [one for one in own if name in ("", one.name)]
    if not chosen:
        known = known_names(str(name), [one.name for one in own])
        raise UsageError(f"{spec.type}: {victim} has no {kind} {name!r}; {known}")
    return chosen
