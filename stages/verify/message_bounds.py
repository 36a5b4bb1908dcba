"""Whether messages keep to the bounds that the attacks on them declare."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.labels.declaration import Terms
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MessageChange
from advpipe.pipeline.labels.quantity import beyond_all
from advpipe.stages.verify.attackers import DeclaredAttackers
from advpipe.stages.verify.declared_bounds import measurable
from advpipe.stages.verify.message_store import MessageStore


def beyond_declared(change: MessageChange, declared: Sequence[Terms]) -> str:
    """How a message is beyond the bounds of every attack that could have touched it; mostly ""."""
    bounds = [measurable(one.bounds, MESSAGE_QUANTITIES) for one in declared]
    return beyond_all(change, bounds, MESSAGE_QUANTITIES)


def too_many_added(store: MessageStore, attackers: DeclaredAttackers) -> Iterator[tuple[int, str]]:
    """Numbers of messages with which attackers have added more in a second than they declare, and how."""
    for added in store.added():
        attacker = attackers.only_at(added.place, added.station_id)
        if attacker is None:
            continue
        declared = attackers.declared(
            attacker.name, added.station_id, attacker.parts.get(added.station_id, "")
        )
        change = MessageChange(attackers.geodesy, added_in_a_second=added.in_a_second)
        if what := beyond_declared(change, declared or ()):
            yield added.number, what
