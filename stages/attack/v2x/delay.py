"""Delayed messages of the attacker: sent late, or replaced by its earlier ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from advpipe.pipeline.labels.claims import ALL_CLAIMS, Claim
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.message_quantities import DELAY
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.bounds import checked_integer, checked_number, checked_range
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.overheard_messages import with_later_time, without_true_time


class Delay(V2xAttack):
    """Sends each message late, by a delay that each attacker draws once.

    restamp: delay the generation time as well, so that receivers' LDMs accept the message, as NextGen's time
    delay attack does; without, the time gives the delay away. Messages that are
    due after the attacker has left the road, or after the drive, are never sent.
    """

    traits = V2xTraits(
        untrue=("generation time",),
        published=Published(nextgen=11, catch_f1=0.062),
        published_of={"preset": "nextgen"},
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        delay_min_s: float = 2.0,
        delay_max_s: float = 4.0,
        restamp: bool = False,
    ) -> None:
        super().__init__(context)
        least_s, most_s = checked_range(context.name, "delay_{}_s", delay_min_s, delay_max_s, 0, 600)
        self._restamp = bool(restamp)
        self._delays_ns = {
            attacker: round(float(context.rng("delay", attacker).uniform(least_s, most_s)) * 1e9)
            for attacker in context.attackers
        }
        self._held: list[Sent] = []

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        return {DELAY.name: (parameters["delay_min_s"], parameters["delay_max_s"])}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        return super().untrue(parameters) if parameters["restamp"] else ()

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        kept = []
        for message in sent:
            if self.context.acts(message):
                self._held.append(
                    replace(message, request_ns=message.request_ns + self._delays_ns[message.station_id])
                )
            else:
                kept.append(message)
        if step.end_ns is None:
            return kept
        due = [message for message in self._held if message.request_ns < step.end_ns]
        self._held = [message for message in self._held if message.request_ns >= step.end_ns]
        present = {radio.station_id for radio in step.radios}
        return kept + [self._released(message) for message in due if message.station_id in present]

    def _released(self, message: Sent) -> Sent:
        cams = self.context.cams
        tree = cams.open(message.payload) if self._restamp else None
        if tree is None:
            return message
        return replace(
            message, payload=cams.close(with_later_time(tree, self._delays_ns[message.station_id]))
        )


class Stale(V2xAttack):
    """Repeats the attacker's own CAM of `messages` messages ago: F2MD's stale messages (there, 60 at 1 Hz).

    restamp: with the generation time of the message that it replaces. The first `messages` CAMs stay
    unchanged.
    """

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim != "station id"),
        begins_true=True,
        published=Published(veremi_extension=12),
    )

    def __init__(
        self, context: AttackContext, *, messages: int = 20, restamp: bool = True, ahead_s: float = 0.0
    ) -> None:
        super().__init__(context)
        self._messages = checked_integer(context.name, "messages", messages, 1, 100_000)
        self._restamp = bool(restamp)
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._history: dict[int, deque[CamTree]] = {}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        return without_true_time(super().untrue(parameters), parameters)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        return [
            self._aged(message) if message.station_id in self.context.attackers else message
            for message in in_order
        ]

    def _aged(self, message: Sent) -> Sent:
        cams = self.context.cams
        own = cams.open(message.payload)
        if own is None:
            return message
        history = self._history.setdefault(message.station_id, deque(maxlen=self._messages + 1))
        history.append(own)
        if len(history) <= self._messages or not self.context.active(message.request_ns):
            return message
        old = history[0]
        if self._restamp:
            old = with_fields(old, generation_delta_time_ms=field_of(own, "generation_delta_time_ms"))
        return replace(message, payload=cams.close(with_later_time(old, self._ahead_ns)))
