"""Whether the labels of a message tell what happened to it between the clean and the adversarial bag."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from advpipe.pipeline.labels.claims import undeclared_fields
from advpipe.pipeline.labels.declaration import Terms
from advpipe.pipeline.labels.message_quantities import MessageChange
from advpipe.pipeline.labels.messages import ACTIONS, ADDED, AXES, CHANGED, CORRUPT, DELAYED, DROPPED
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.facilities.cam_values import (
    FIELDS,
    OTHER,
    SEPARATOR,
    Values,
    changed_fields,
    places_m,
    values_of_payload,
)
from advpipe.pipeline.v2x.facilities.effect import has_effect
from advpipe.stages.verify.attackers import DeclaredAttackers
from advpipe.stages.verify.message_bounds import beyond_declared
from advpipe.stages.verify.message_store import Message, MessageDiff, MessageStore, Row

ROUNDING_M = 1e-6
"""Between two machines' projections."""

_BYTES = (CHANGED, CORRUPT)


class _State(NamedTuple):
    """A message between two attacks: who sends it, when, and what it says."""

    station_id: int
    request_ns: int
    values: Values | None


@dataclass
class MessageLabels:
    """Follows each message from the clean bag through its labels, one an attack, to the adversarial bag.

    All columns are compared: with the bags (`station_id`, `time_ns`, `sent_ns`, `action`, `true_...`,
    `false_...`), with the attacks that the bag names (`attack`, `attacker`, `sender`, `part`, and whether the
    attack was on at that time), with the rules by which they are made (`fields`, `mattered`), and with what
    the attacks declare: what is untrue, and bounds. What
    cannot be known is believed: which of two attacks of one name and sender touched a message; what it said
    before the last of several attacks; what it says where congestion control held it back; whether chance, or
    pauses, had a GPS attack on within its span.

    reacts: whether congestion control may have held messages back. chained: how many were changed by several
    attacks.
    """

    store: MessageStore
    attackers: DeclaredAttackers
    reacts: bool
    chained: int = 0

    def is_held_back(self, station_id: int) -> bool:
        """Whether a message of this station may be missing without a label."""
        return self.reacts and station_id not in self.attackers.attackers

    def first_wrong(self, diff: MessageDiff) -> Iterator[str]:
        """What is wrong first with the labels of a message, if anything."""
        self.chained += len(diff.labels) > 1
        return islice(self._wrong(diff), 1)

    def _wrong(self, diff: MessageDiff) -> Iterator[str]:
        recorded = before = None if diff.clean is None else _state(diff.clean)
        is_late = False
        for row in diff.labels:
            origin = before
            if row["action"] == CHANGED and recorded is not None:
                # What was delayed into another step is judged by what it was then.
                origin = before if is_late and row["time_ns"] != recorded.request_ns else recorded
            yield from _action(row, before, diff.forged)
            yield from self._who(row, before)
            yield from _times(row, origin)
            yield from _values(row, "true", self._honest(row, origin))
            is_late |= row["action"] == DELAYED
            after = None if row["action"] == DROPPED else _after(row)
            if after is None:
                yield from _values(row, "false", None)
            if row is diff.labels[-1]:
                yield from self._end(diff, after)
            elif after is None:
                yield "has another label after it was dropped"
            yield from self._places(row)
            declared = self.attackers.declared(row["attack"], row["station_id"], row.get("part", ""))
            yield from self._judged(row, before, declared)
            yield from _undeclared(row, before, declared or ())
            yield from self._beyond(row, before, after, declared or ())
            before = after

    def _who(self, row: Row, before: _State | None) -> Iterator[str]:
        """Sender, attack, attacker, part, and whether the attack was on."""
        number, name = row["station_id"], row["attack"]
        sender = self.attackers.names.get(number, "")
        if row["sender"] != sender:
            yield f"was sent by {sender or 'an unknown station'}, but its label says {row['sender']}"
        named = self.attackers.named(name)
        if not named:
            yield f"is labelled {name}, which is not one of the bag's attacks"
        attackers = [one for one in named if number in one.senders]
        if not attackers:
            yield f"was sent by {sender}, whose messages {name} does not attack"
        if row["attacker"] not in {sender if one.is_sender else "" for one in attackers}:
            yield f"has the wrong attacker in its label: {row['attacker'] or 'none'}"
        attackers = [
            one
            for one in attackers
            if "part" not in row or one.is_undeclared or row["part"] == one.parts.get(number, "")
        ]
        if not attackers:
            yield f"is labelled with part {row['part']!r} of {name}, which its sender does not carry out"
        time_ns = row["time_ns"] if before is None else before.request_ns
        if not any(one.acts(time_ns) for one in attackers):
            yield f"was attacked at {time_ns} ns, when {name} was not active"

    def _honest(self, row: Row, origin: _State | None) -> Values | None:
        """What an honest one would have said: of a new or late one, the last of who it claims to be."""
        if row["action"] not in (ADDED, DELAYED):
            return None if origin is None else origin.values
        station_id = row["false_station_id"]
        payload = None if station_id is None else self.store.last_of(station_id, row["sent_ns"])
        return None if payload is None else values_of_payload(payload)

    def _end(self, diff: MessageDiff, stated: _State | None) -> Iterator[str]:
        """Whether the adversarial bag holds what the last label tells."""
        row, clean, forged = diff.labels[-1], diff.clean, diff.forged
        if forged is None:
            if stated is not None and not self.is_held_back(stated.station_id):
                yield "is missing, but no label says that it was dropped"
            return
        if stated is None:
            yield "is labelled dropped, but was sent"
            return
        if stated.request_ns != forged.request_ns:
            yield f"was sent at {forged.request_ns} ns, but its label says {stated.request_ns}"
        is_same = clean is not None and clean.payload == forged.payload
        if len(diff.labels) == 1 and is_same == (row["action"] == CHANGED) and row["action"] in _BYTES:
            yield f"is labelled {row['action']}, but was not"
        yield from _values(row, "false", values_of_payload(forged.payload))

    def _beyond(
        self, row: Row, before: _State | None, after: _State | None, declared: Sequence[Terms]
    ) -> Iterator[str]:
        """Beyond the bounds of all attacks that could have changed or delayed it."""
        if row["action"] not in (CHANGED, DELAYED) or before is None or after is None:
            return
        delay_s = (after.request_ns - before.request_ns) / NS_PER_S
        change = MessageChange(self.attackers.geodesy, before.values, after.values, delay_s)
        if what := beyond_declared(change, declared):
            yield f"exceeds the bounds of {row.get('part') or row['attack']}: {what}"

    def _places(self, row: Row) -> Iterator[str]:
        """x and y, which follow from latitude and longitude."""
        expected_m = places_m(
            self.attackers.geodesy, [_label_values(row, "true"), _label_values(row, "false")]
        )
        for kind, place_m in zip(("true", "false"), expected_m.T.tolist(), strict=True):
            for axis, value_m in zip(AXES, place_m, strict=True):
                stated_m = _number(row[f"{kind}_{axis}"])
                if math.isnan(stated_m) != math.isnan(value_m) or abs(stated_m - value_m) > ROUNDING_M:
                    yield f"has a position that differs from its label's {kind}_{axis}"

    def _judged(self, row: Row, before: _State | None, declared: Sequence[Terms] | None) -> Iterator[str]:
        """`fields` and `mattered`, which follow from the other columns."""
        true, false = _label_values(row, "true"), _label_values(row, "false")
        fields, said = "", None if before is None else before.values
        if row["action"] == CHANGED and said is not None and false is not None:
            fields = changed_fields(said, false)
        if row.get("fields", fields) != fields:
            yield f"had {fields or 'nothing'} changed, but its label says {row['fields'] or 'nothing'}"
        always = any(one.every_message_matters for one in declared or ())
        mattered = row["action"] == DROPPED or always
        if not mattered:
            moved_m = math.hypot(*(_number(row[f"true_{a}"]) - _number(row[f"false_{a}"]) for a in AXES))
            mattered = has_effect(true, false, moved_m, self.attackers.expiry_s)
        if declared is None and not mattered:
            return
        if row["mattered"] is not (mattered and row["action"] != CORRUPT):
            yield (
                f"is labelled mattered={row['mattered']}, but by the rule it should be {not row['mattered']}"
            )


def _undeclared(row: Row, before: _State | None, declared: Sequence[Terms]) -> Iterator[str]:
    """The fields of a message that were changed, and that no attack that could have done it makes untrue."""
    if row["action"] not in (CHANGED, DELAYED) or before is None or not declared:
        return
    said, says = before.values, _label_values(row, "false")
    if row["action"] == DELAYED and said == says:
        return
    changed = OTHER if said is None or says is None else changed_fields(said, says)
    found = [undeclared_fields(changed, frozenset(one.untrue)) for one in declared]
    if all(found):
        what = f"only the {', '.join(declared[0].untrue)}" if declared[0].untrue else "nothing"
        name = row.get("part") or row["attack"]
        yield f"had {SEPARATOR.join(found[0])} changed; {name} declares {what} untrue"


def _action(row: Row, before: _State | None, forged: Message | None) -> Iterator[str]:
    """What happened to it, as far as its being there tells, and from whose radio it is."""
    action, known = row["action"], before or forged
    if action not in ACTIONS:
        yield f"is labelled {action}, which is not one of {', '.join(ACTIONS)}"
    if (action == ADDED) != (before is None):
        yield f"is labelled {action}, which contradicts the clean bag"
    if known is None:
        yield "is labelled, but neither bag holds it"
    elif row["station_id"] != known.station_id:
        yield f"was sent by station {known.station_id}, but its label says {row['station_id']}"
    if action == CORRUPT and before is not None and before.values is not None:
        yield "is labelled corrupt, but is a valid CAM"


def _times(row: Row, origin: _State | None) -> Iterator[str]:
    action, time_ns, sent_ns = row["action"], row["time_ns"], row["sent_ns"]
    if (sent_ns is None) != (action == DROPPED):
        yield f"is labelled {action}, but with sent_ns {sent_ns}"
    if origin is not None and time_ns != origin.request_ns:
        yield f"was recorded at {origin.request_ns} ns, but its label says {time_ns}"
    if action in (ADDED, CORRUPT) and sent_ns != time_ns:
        yield f"is labelled {action}, but with time_ns {time_ns} and sent_ns {sent_ns}"
    if action == DELAYED and sent_ns <= time_ns:
        yield f"is labelled delayed, but from {time_ns} ns to {sent_ns} ns"


def _values(row: Row, kind: str, said: Values | None) -> Iterator[str]:
    """The first field that a label tells otherwise than a message."""
    for name in FIELDS:
        if row[f"{kind}_{name}"] != (None if said is None else said[name]):
            yield f"differs from its label's {kind}_{name}"


def _state(message: Message) -> _State:
    return _State(message.station_id, message.request_ns, values_of_payload(message.payload))


def _after(row: Row) -> _State:
    return _State(row["station_id"], row["sent_ns"], _label_values(row, "false"))


def _label_values(row: Row, kind: str) -> Values | None:
    """The fields of a label; None where it is of no CAM."""
    if row[f"{kind}_station_id"] is None:
        return None
    return {name: row[f"{kind}_{name}"] for name in FIELDS}


def _number(value: float | None) -> float:
    return math.nan if value is None else value
