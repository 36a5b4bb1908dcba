"""Floods at a multiple of an attacker's own rate."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.overheard_messages import with_later_time


class _Due(NamedTuple):
    """A further message: when it is sent, after which own one, and its place after that, from 1 on."""

    at_ns: int
    own: Sent
    place: int


class OwnRateFlood(V2xAttack):
    """Several messages for each of an attacker's own ones, in equal intervals.

    multiples: how many for each attacker, who draws one of them. Their intervals divide that of the
    attacker's last two own messages; what is due after the next own one is not sent, unless it `keeps_due`.
    """

    keeps_due = False

    def __init__(self, context: AttackContext, multiples: Sequence[int]) -> None:
        super().__init__(context)
        self.rngs = {attacker: context.rng("flood", attacker) for attacker in context.attackers}
        self.multiples = {
            attacker: multiples[int(rng.integers(len(multiples)))] for attacker, rng in self.rngs.items()
        }
        self._due: dict[int, list[_Due]] = {attacker: [] for attacker in context.attackers}
        self._last_ns: dict[int, int] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited = list[Sent]()
        present = {radio.station_id for radio in step.radios}
        for message in sorted(sent, key=lambda one: (one.request_ns, one.number)):
            if message.station_id not in self.context.attacking:
                edited.append(message)
                continue
            edited += self._take_due(step, message.station_id, message.request_ns)
            edited.append(self._own(step, message))
            self._plan(message)
        if step.end_ns is not None:
            for attacker in self.context.attackers:
                due = self._take_due(step, attacker, step.end_ns)
                edited += due if attacker in present else ()
        self.remember(step, sent)
        return edited

    def _own(self, step: V2xStep, message: Sent) -> Sent:
        """An own message, or what is sent instead of it."""
        tree = self.content(step, message, message.request_ns, 0) if self.context.acts(message) else None
        return message if tree is None else self.instead(message, self.context.cams.close(tree))

    def instead(self, message: Sent, payload: bytes) -> Sent:
        """An own message with another payload; one with the same becomes a message of the attack, too."""
        if payload == message.payload:
            return self.context.message(message.station_id, message.request_ns, payload, message.power_dbm)
        return replace(message, payload=payload)

    def _plan(self, message: Sent) -> None:
        """Find out when more messages follow an own one."""
        attacker, due = message.station_id, list[_Due]()
        if self.context.acts(message):
            multiple = self.multiples[attacker]
            spacing_ns = self.spacing_ns(attacker, message.request_ns - self._last_ns.get(attacker, 1 << 62))
            if spacing_ns > 0:
                due = [
                    _Due(message.request_ns + place * spacing_ns, message, place)
                    for place in range(1, multiple)
                ]
        self._due[attacker] = [*self._due[attacker], *due] if self.keeps_due else due
        self._last_ns[attacker] = message.request_ns

    def spacing_ns(self, attacker: int, interval_ns: int) -> int:
        """The time between messages after one that followed its predecessor after an interval; negative for
        an unknown interval, after which none follow."""
        return interval_ns // self.multiples[attacker]

    def _take_due(self, step: V2xStep, attacker: int, until_ns: int) -> list[Sent]:
        found, self._due[attacker] = self._due[attacker], []
        taken = list[Sent]()
        for one in found:
            if one.at_ns >= until_ns:
                self._due[attacker].append(one)
            elif one.at_ns >= step.begin_ns and self.context.active(one.at_ns):
                tree = self.content(step, one.own, one.at_ns, one.place)
                if tree is not None:
                    taken.append(
                        self.context.message(
                            attacker, one.at_ns, self.context.cams.close(tree), one.own.power_dbm
                        )
                    )
        return taken

    def remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Hook after a step, with the messages that attackers could overhear."""

    @abstractmethod
    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        """What is sent at a time after an attacker's own message, which has place 0; None for the own message
        as it is, or for none."""


def as_own(tree: CamTree, own: CamTree, later_ns: int) -> CamTree:
    """The CAM of another station, as one of the attacker's that is generated a time after its own one."""
    names = "station_id", "generation_delta_time_ms"
    return with_later_time(with_fields(tree, **{name: field_of(own, name) for name in names}), later_ns)
