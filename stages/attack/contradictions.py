"""Attacks that cannot be carried out together: two that say different things in the same place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import AttackSpec

ALL = frozenset({"position", "speed", "heading", "acceleration", "dimensions", "station id"})
_STOP = frozenset({"position", "speed", "heading", "acceleration"})

SETS: dict[str, frozenset[str]] = {
    "cam-position-constant": frozenset({"position"}),
    "cam-position-offset": frozenset({"position"}),
    "cam-position-random": frozenset({"position"}),
    "cam-position-random-offset": frozenset({"position"}),
    "cam-position-mirrored": frozenset({"position"}),
    "cam-speed-constant": frozenset({"speed"}),
    "cam-speed-offset": frozenset({"speed"}),
    "cam-speed-random": frozenset({"speed"}),
    "cam-speed-random-offset": frozenset({"speed"}),
    "cam-speed-frozen": frozenset({"speed"}),
    "cam-heading-reversed": frozenset({"heading"}),
    "cam-heading-rotating": frozenset({"heading"}),
    "cam-acceleration": frozenset({"acceleration"}),
    "cam-feigned-braking": frozenset({"acceleration"}),
    "cam-dimensions": frozenset({"dimensions"}),
    "cam-out-of-range": ALL,
    "cam-eventual-stop": _STOP,
    "cam-sudden-stop": _STOP,
    "cam-mix": ALL,
    "cam-replay": ALL,
    "cam-disruptive-replay": ALL,
    "cam-stale": ALL - {"station id"},
    "cam-masquerade": frozenset({"station id"}),
}
"""What an attack says in its attackers' own messages; the others only add, delay or drop some."""


def refuse_contradictions(reader: BagReader, attacks: Sequence[AttackSpec], seed: int) -> None:
    """Raises AdvpipeError for two attacks that set the same field of the same V2X messages at the same time.

    Two on the same clouds, and two on one vehicle's GPS, are refused where these are found: in
    `clouds.plan_clouds` and `gnss.strikes`.
    """
    attackers: Callable[[AttackSpec], tuple[int, ...]] | None = None
    for one, other in combinations(attacks, 2):
        shared = SETS.get(one.type, frozenset()) & SETS.get(other.type, frozenset())
        if not shared or not one.schedule.overlaps(other.schedule):
            continue
        if attackers is None:  # it takes a look through the drive
            from advpipe.pipeline.replay.v2x_attackers import Cast

            attackers = Cast(V2xDrive(reader), str(reader.path), seed).attackers
        if not set(attackers(one)).isdisjoint(attackers(other)):
            raise UsageError(
                f"{one.type} and {other.type} contradict each other: both set the {min(shared)} of the same "
                "messages at the same time; give them other attackers, or schedules that do not overlap"
            )
