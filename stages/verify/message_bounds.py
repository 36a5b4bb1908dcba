"""Whether changed messages stay within the declared bounds of the attacks on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.labels.declaration import Terms
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MessageChange
from advpipe.pipeline.labels.quantity import beyond_all
from advpipe.stages.verify.attackers import DeclaredAttackers
from advpipe.stages.verify.declared_bounds import measurable
from advpipe.stages.verify.message_store import MessageStore


def beyond_declared(change: MessageChange, declared: Sequence[Terms]) -> str:
    """How a message exceeds the bounds of every attack that could have touched it; "" if it does not."""
    bounds = [measurable(terms.bounds, MESSAGE_QUANTITIES) for terms in declared]
    return beyond_all(change, bounds, MESSAGE_QUANTITIES)


def too_many_added(store: MessageStore, attackers: DeclaredAttackers) -> Iterator[tuple[int, str]]:
    """Numbers of the messages by which attackers exceed their declared rate of added messages, and how."""
    for added in store.added():
        attacker = attackers.attacker_at(added.attack_index, added.station_id)
        if attacker is None:
            continue
        declared = attackers.declared(
            attacker.name, added.station_id, attacker.parts.get(added.station_id, "")
        )
        change = MessageChange(attackers.geodesy, added_in_a_second=added.in_a_second)
        if what := beyond_declared(change, declared or ()):
            yield added.number, what
