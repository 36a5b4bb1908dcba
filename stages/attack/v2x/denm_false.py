"""Warnings of events that do not happen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.message_quantities import MESSAGES_ADDED
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.denm import ActionId, Denm, EventKind, encode_denm
from advpipe.pipeline.v2x.facilities.reference_point import reference_point
from advpipe.pipeline.v2x.message_type import DENM
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits

KINDS = {kind.name.lower(): kind for kind in EventKind}
FAR_M = 300.0
"""An event farther than this from its target has no effect on it: another one follows."""
MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 1_000.0


@dataclass
class _FalseEvent:
    denm: Denm
    place_m: Float64
    next_ns: int


class DenmFalse(V2xAttack):
    """Warns of a vehicle that has stopped, brakes hard or is about to collide, where there is none.

    kind: "braking", "stopped" or "collision". The event is distance_m ahead of the victim, or of the attacker
    itself if there is none, when it is announced; once its target has passed it or is 300 m away, another one
    follows. rate_hz: how often an attacker sends the DENM. validity_s: for how long receivers are to believe
    it. place: `ahead`, or `random`, anywhere within distance_m of the target, the baseline with as many
    DENMs.
    """

    traits = V2xTraits(every_message_matters=True, needs_traffic=False, message_types=(DENM.name,))

    def __init__(
        self,
        context: AttackContext,
        *,
        kind: str = "braking",
        distance_m: float = 50.0,
        rate_hz: float = 2.0,
        validity_s: int = 10,
        place: str = "ahead",
    ) -> None:
        super().__init__(context)
        self._kind = KINDS[checked_choice(context.name, "kind", kind, KINDS)]
        self._distance_m = checked_number(context.name, "distance_m", distance_m, -1000, 1000)
        rate_hz = checked_number(context.name, "rate_hz", rate_hz, MIN_RATE_HZ, MAX_RATE_HZ)
        self._interval_ns = _interval_ns(rate_hz)
        self._validity_s = checked_integer(context.name, "validity_s", validity_s, 1, 86_400)
        self._is_random = checked_choice(context.name, "place", place, ("ahead", "random")) == "random"
        self._events: dict[int, _FalseEvent] = {}
        self._numbers: dict[int, int] = {}

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        rate_hz = min(max(parameters["rate_hz"], MIN_RATE_HZ), MAX_RATE_HZ)  # other rates are rejected
        return {MESSAGES_ADDED.name: (0, math.ceil(1e9 / _interval_ns(rate_hz)))}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited, context = list(sent), self.context
        if step.end_ns is None:
            return edited
        for attacker in context.attackers:
            radio = context.radio(step, attacker)
            target = radio if context.victim is None else context.radio(step, context.victim)
            if radio is None or target is None:
                self._events.pop(attacker, None)
                continue
            edited += self._warn(step.begin_ns, step.end_ns, attacker, target)
        return edited

    def _warn(self, begin_ns: int, end_ns: int, attacker: int, target: RadioPlace) -> Iterator[Sent]:
        event = self._events.get(attacker)
        if event is None or self._is_over(event, target):
            next_ns = begin_ns if event is None else max(event.next_ns, begin_ns)
            event = self._events[attacker] = self._announce(next_ns, attacker, target)
        while event.next_ns < end_ns:
            if self.context.active(event.next_ns):
                denm = replace(event.denm, station_id=self.context.identities.of(attacker))
                yield self.context.message(attacker, event.next_ns, encode_denm(denm))
            event.next_ns += self._interval_ns

    def _announce(self, now_ns: int, attacker: int, target: RadioPlace) -> _FalseEvent:
        rng = self.context.rng("phase", attacker)
        phase_ns = int(rng.integers(self._interval_ns)) if attacker not in self._events else 0
        pose = target.map_SE3_base.copy()
        pose[:3, 3] += pose[:3, :2] @ self._offset_m(attacker, now_ns, target)
        place = reference_point(self.context.geodesy, pose, 0.0)
        number = self._numbers[attacker] = (self._numbers.get(attacker, int(rng.integers(2**16))) + 1) % 2**16
        station_id = self.context.identities.of(attacker)
        denm = Denm(
            station_id=station_id,
            action=ActionId(station_id, number),
            detection_ns=now_ns,
            reference_ns=now_ns,
            station_type=StationType.PASSENGER_CAR,
            latitude_deg=place.latitude_deg,
            longitude_deg=place.longitude_deg,
            altitude_m=place.altitude_m,
            validity_s=self._validity_s,
            interval_s=min(max(self._interval_ns / 1e9, 0.001), 10.0),
            kind=self._kind,
            speed_mps=0.0,
            heading_rad=place.heading_rad,
        )
        return _FalseEvent(denm, pose[:3, 3], now_ns + phase_ns)

    def _offset_m(self, attacker: int, now_ns: int, target: RadioPlace) -> Float64:
        """Where the event is from the target's centre: forward and to the left."""
        if not self._is_random:
            return np.array([target.size_m[0] / 2 + self._distance_m, 0.0])
        rng = self.context.rng("place", attacker, now_ns)
        radius_m, angle_rad = abs(self._distance_m) * math.sqrt(rng.random()), math.tau * rng.random()
        return radius_m * np.array([math.cos(angle_rad), math.sin(angle_rad)])

    def _is_over(self, event: _FalseEvent, target: RadioPlace) -> bool:
        """Whether the target has passed the event, or is far from it."""
        apart_m = event.place_m - target.map_SE3_base[:3, 3]
        away_m = float(np.linalg.norm(apart_m))
        if self._is_random:
            return away_m > 2 * abs(self._distance_m)
        is_passed = self._distance_m > 0 and float(apart_m @ target.map_SE3_base[:3, 0]) < 0
        return is_passed or away_m > max(FAR_M, 2 * abs(self._distance_m))


def _interval_ns(rate_hz: float) -> int:
    return round(1e9 / rate_hz)
