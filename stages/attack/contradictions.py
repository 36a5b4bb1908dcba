"""Attacks that cannot be combined: two that set the same field of the same messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.parameters import preset_class, resolved_parameters
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS


def refuse_contradictions(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> None:
    """Raises AdvpipeError for two V2X attacks that set the same field of the same messages at the same time.

    Two attacks on the same clouds, and two on one vehicle's GPS, are refused elsewhere: in
    `clouds.plan_clouds` and `gnss.spoofing_schedule`.
    """
    attackers: Callable[[AttackSpec], tuple[int, ...]] | None = None
    for one, other in combinations(attacks, 2):
        shared = _untrue(one) & _untrue(other)
        if not shared or not one.schedule.overlaps(other.schedule):
            continue
        if attackers is None:  # finding them reads the drive
            from advpipe.pipeline.replay.v2x_attackers import AttackerSelection

            attackers = AttackerSelection(V2xDrive(reader), str(reader.path), seed).attackers
        if not set(attackers(one)).isdisjoint(attackers(other)):
            raise UsageError(
                f"{one.type} and {other.type} contradict each other: both set the {min(shared)} of the same "
                "messages at the same time; give them other attackers, or schedules that do not overlap"
            )


def _untrue(spec: AttackSpec) -> frozenset[str]:
    """The claims that the attack falsifies in its attackers' messages; none if it only adds, delays or drops
    messages."""
    attack_class = V2X_ATTACKS.find(spec.type)
    return frozenset(preset_class(spec, attack_class).untrue(resolved_parameters(spec, attack_class)))
