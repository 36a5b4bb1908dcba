"""Attacks that cannot be carried out together: two that say different things in the same place."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.registry import find_attack


def refuse_contradictions(attacks: Sequence[AttackSpec]) -> None:
    """Raises AdvpipeError for two attacks that set the same field of the same messages at the same time.

    Two GPS attacks on one vehicle both set its fixes. Attacks on V2X messages say what they set in
    `sets`; those that only add messages, hold them back or send them again set nothing. Two on the same
    clouds are refused where the clouds are known (`clouds.plan_clouds`).
    """
    for one, other in combinations(attacks, 2):
        if one.family != other.family or not one.schedule.overlaps(other.schedule):
            continue
        shared = _sets(one) & _sets(other)
        if shared and _same_messages(one, other):
            raise AdvpipeError(
                f"{one.type} and {other.type} contradict each other: both set {min(shared)} of the same "
                "messages at the same time; give them schedules that do not overlap, or other targets"
            )


def _sets(spec: AttackSpec) -> frozenset[str]:
    if spec.family == "gnss":
        return frozenset({"the fixes"})
    if spec.family == "cam":
        return frozenset(getattr(find_attack(spec.type), "sets", ()))
    return frozenset()


def _same_messages(one: AttackSpec, other: AttackSpec) -> bool:
    """Whether a message of the one may be a message of the other."""
    if one.family == "gnss":
        return one.victim == other.victim or None in (one.victim, other.victim)
    ours, theirs = one.attackers, other.attackers
    if ours is None or theirs is None or ours == theirs:
        return (ours, one.seed_name) == (theirs, other.seed_name) or ours is None or theirs is None
    if ours.vehicles and theirs.vehicles:
        return not set(ours.vehicles).isdisjoint(theirs.vehicles)
    return ours.roadside_unit is None and theirs.roadside_unit is None
