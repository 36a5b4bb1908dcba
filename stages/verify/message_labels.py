"""Whether a message's labels explain its change from the clean to the adversarial bag."""

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
"""Tolerance between projections on different machines."""

_BYTES = (CHANGED, CORRUPT)


class _State(NamedTuple):
    """A message between two attacks: its sender, time and content."""

    station_id: int
    request_ns: int
    values: Values | None


@dataclass
class MessageLabels:
    """Traces each message from the clean bag through its labels, one per attack, to the adversarial bag.

    All columns are compared: with the bags (`station_id`, `time_ns`, `sent_ns`, `action`, `true_...`,
    `false_...`), with the attacks in the provenance (`attack`, `attacker`, `sender`, `part`, and whether the
    attack was active at that time), with the rules that define them (`fields`, `mattered`), and with the
    attacks' declarations (untrue claims and bounds). Accepted without a check, because the bags do not record
    it: which of two attacks with the same name and sender touched a message; its contents before the last of
    several attacks; its contents if congestion control held it back; and whether a GPS attack with a random
    or periodic schedule was active at a time within its span.

    reacts: whether congestion control may have held messages back. chained: number of messages that several
    attacks changed.
    """

    store: MessageStore
    attackers: DeclaredAttackers
    reacts: bool
    chained: int = 0

    def is_held_back(self, station_id: int) -> bool:
        """Whether a message of this station may be missing without a label."""
        return self.reacts and station_id not in self.attackers.attackers

    def first_fault(self, diff: MessageDiff) -> Iterator[str]:
        """The first fault of a message's labels, if there is any."""
        self.chained += len(diff.labels) > 1
        return islice(self._faults(diff), 1)

    def _faults(self, diff: MessageDiff) -> Iterator[str]:
        recorded = before = None if diff.clean is None else _state(diff.clean)
        is_late = False
        for row in diff.labels:
            origin = before
            if row["action"] == CHANGED and recorded is not None:
                # A message that was delayed into another step is compared with its state then.
                origin = before if is_late and row["time_ns"] != recorded.request_ns else recorded
            yield from _check_action(row, before, diff.forged)
            yield from self._check_sender(row, before)
            yield from _check_times(row, origin)
            yield from _check_values(row, "true", self._true_values(row, origin))
            is_late |= row["action"] == DELAYED
            after = None if row["action"] == DROPPED else _after(row)
            if after is None:
                yield from _check_values(row, "false", None)
            if row is diff.labels[-1]:
                yield from self._check_forged(diff, after)
            elif after is None:
                yield "has another label after it was dropped"
            yield from self._check_positions(row)
            declared = self.attackers.declared(row["attack"], row["station_id"], row.get("part", ""))
            yield from self._check_rules(row, before, declared)
            yield from _check_untrue(row, before, declared or ())
            yield from self._check_bounds(row, before, after, declared or ())
            before = after

    def _check_sender(self, row: Row, before: _State | None) -> Iterator[str]:
        """Check sender, attack, attacker, part, and whether the attack was active."""
        number, name = row["station_id"], row["attack"]
        sender = self.attackers.names.get(number, "")
        if row["sender"] != sender:
            yield f"was sent by {sender or 'an unknown station'}, but its label says {row['sender']}"
        named = self.attackers.named(name)
        if not named:
            yield f"is labelled {name}, which is not one of the bag's attacks"
        attackers = [attacker for attacker in named if number in attacker.senders]
        if not attackers:
            yield f"was sent by {sender}, whose messages {name} does not attack"
        if row["attacker"] not in {sender if attacker.is_sender else "" for attacker in attackers}:
            yield f"has the wrong attacker in its label: {row['attacker'] or 'none'}"
        attackers = [
            attacker
            for attacker in attackers
            if "part" not in row or attacker.is_undeclared or row["part"] == attacker.parts.get(number, "")
        ]
        if not attackers:
            yield f"is labelled with part {row['part']!r} of {name}, which its sender does not carry out"
        time_ns = row["time_ns"] if before is None else before.request_ns
        if not any(attacker.acts(time_ns) for attacker in attackers):
            yield f"was attacked at {time_ns} ns, when {name} was not active"

    def _true_values(self, row: Row, origin: _State | None) -> Values | None:
        """The true values; for an added or delayed message, those of the claimed station's last message."""
        if row["action"] not in (ADDED, DELAYED):
            return None if origin is None else origin.values
        station_id = row["false_station_id"]
        radio = self.attackers.radios.get(station_id, station_id)
        payload = None if radio is None else self.store.last_cam_of(radio, row["sent_ns"])
        return None if payload is None else values_of_payload(payload)

    def _check_forged(self, diff: MessageDiff, stated: _State | None) -> Iterator[str]:
        """Check that the adversarial bag contains the message that the last label describes."""
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
        yield from _check_values(row, "false", values_of_payload(forged.payload))

    def _check_bounds(
        self, row: Row, before: _State | None, after: _State | None, declared: Sequence[Terms]
    ) -> Iterator[str]:
        """Check the bounds of every attack that could have changed or delayed the message."""
        if row["action"] not in (CHANGED, DELAYED) or before is None or after is None:
            return
        delay_s = (after.request_ns - before.request_ns) / NS_PER_S
        change = MessageChange(self.attackers.geodesy, before.values, after.values, delay_s)
        if what := beyond_declared(change, declared):
            yield f"exceeds the bounds of {row.get('part') or row['attack']}: {what}"

    def _check_positions(self, row: Row) -> Iterator[str]:
        """Check x and y, which follow from latitude and longitude."""
        expected_m = places_m(
            self.attackers.geodesy, [_label_values(row, "true"), _label_values(row, "false")]
        )
        for state, place_m in zip(("true", "false"), expected_m.T.tolist(), strict=True):
            for axis, value_m in zip(AXES, place_m, strict=True):
                stated_m = _number(row[f"{state}_{axis}"])
                if math.isnan(stated_m) != math.isnan(value_m) or abs(stated_m - value_m) > ROUNDING_M:
                    yield f"has a position that differs from its label's {state}_{axis}"

    def _check_rules(
        self, row: Row, before: _State | None, declared: Sequence[Terms] | None
    ) -> Iterator[str]:
        """Check `fields` and `mattered`, which follow from the other columns."""
        true, false = _label_values(row, "true"), _label_values(row, "false")
        fields, values = "", None if before is None else before.values
        if row["action"] == CHANGED and values is not None and false is not None:
            fields = changed_fields(values, false)
        if row.get("fields", fields) != fields:
            yield f"had {fields or 'nothing'} changed, but its label says {row['fields'] or 'nothing'}"
        always = any(terms.every_message_matters for terms in declared or ())
        mattered = row["action"] == DROPPED or always
        if not mattered:
            moved_m = math.hypot(*(_number(row[f"true_{a}"]) - _number(row[f"false_{a}"]) for a in AXES))
            mattered = has_effect(true, false, moved_m, self.attackers.expiry_s)
        if declared is None and not mattered:
            return
        if any(terms.labelled_as_published for terms in declared or ()):
            return  # by the code of a data set, which judges messages by what came before them, too
        if row["mattered"] is not (mattered and row["action"] != CORRUPT):
            yield (
                f"is labelled mattered={row['mattered']}, but by the rule it should be {not row['mattered']}"
            )


def _check_untrue(row: Row, before: _State | None, declared: Sequence[Terms]) -> Iterator[str]:
    """Check that every changed field is among the declared untrue claims of an attack that could have changed
    it."""
    if row["action"] not in (CHANGED, DELAYED) or before is None or not declared:
        return
    old, new = before.values, _label_values(row, "false")
    if row["action"] == DELAYED and old == new:
        return
    changed = OTHER if old is None or new is None else changed_fields(old, new)
    found = [undeclared_fields(changed, frozenset(terms.untrue)) for terms in declared]
    if all(found):
        what = f"only the {', '.join(declared[0].untrue)}" if declared[0].untrue else "nothing"
        name = row.get("part") or row["attack"]
        yield f"had {SEPARATOR.join(found[0])} changed; {name} declares {what} untrue"


def _check_action(row: Row, before: _State | None, forged: Message | None) -> Iterator[str]:
    """Check the action and the sender against the messages in both bags."""
    action, message = row["action"], before or forged
    if action not in ACTIONS:
        yield f"is labelled {action}, which is not one of {', '.join(ACTIONS)}"
    if (action == ADDED) != (before is None):
        yield f"is labelled {action}, which contradicts the clean bag"
    if message is None:
        yield "is labelled, but neither bag holds it"
    elif row["station_id"] != message.station_id:
        yield f"was sent by station {message.station_id}, but its label says {row['station_id']}"
    if action == CORRUPT and before is not None and before.values is not None:
        yield "is labelled corrupt, but is a valid CAM"


def _check_times(row: Row, origin: _State | None) -> Iterator[str]:
    action, time_ns, sent_ns = row["action"], row["time_ns"], row["sent_ns"]
    if (sent_ns is None) != (action == DROPPED):
        yield f"is labelled {action}, but with sent_ns {sent_ns}"
    if origin is not None and time_ns != origin.request_ns:
        yield f"was recorded at {origin.request_ns} ns, but its label says {time_ns}"
    if action in (ADDED, CORRUPT) and sent_ns != time_ns:
        yield f"is labelled {action}, but with time_ns {time_ns} and sent_ns {sent_ns}"
    if action == DELAYED and sent_ns <= time_ns:
        yield f"is labelled delayed, but from {time_ns} ns to {sent_ns} ns"


def _check_values(row: Row, state: str, values: Values | None) -> Iterator[str]:
    """Check a label's values against those of a message."""
    for name in FIELDS:
        if row[f"{state}_{name}"] != (None if values is None else values[name]):
            yield f"differs from its label's {state}_{name}"


def _state(message: Message) -> _State:
    return _State(message.station_id, message.request_ns, values_of_payload(message.payload))


def _after(row: Row) -> _State:
    return _State(row["station_id"], row["sent_ns"], _label_values(row, "false"))


def _label_values(row: Row, state: str) -> Values | None:
    """The true or false values in a label; None if the message is not a CAM."""
    if row[f"{state}_station_id"] is None:
        return None
    return {name: row[f"{state}_{name}"] for name in FIELDS}


def _number(value: float | None) -> float:
    return math.nan if value is None else value
