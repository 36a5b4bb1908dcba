"""Vehicles that do not exist: they move as they say, and tell of it when the standard has them tell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle, yaw_of
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codes import StationType, TrailerPresence
from advpipe.pipeline.v2x.facilities.generation import (
    CHECK_INTERVAL_NS,
    CamGenerator,
    GenerationRules,
    first_check_ns,
)
from advpipe.pipeline.v2x.facilities.own_state import Accuracy, Identity, own_state
from advpipe.pipeline.v2x.facilities.reference_point import ReferencePoint, reference_points
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack
from advpipe.stages.attack.v2x.gate import Gate

Key = tuple[int, ...]


class GhostMotion(NamedTuple):
    """A phantom at the begin of a step: the ground below its middle (4, 4), and how it moves.

    speed_mps: negative backwards. acceleration_mps2: forward. yaw_rate_radps: positive to the left.
    """

    map_SE3_base: Float64
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_radps: float


@dataclass
class _Station:
    id: int
    generator: CamGenerator
    next_check_ns: int


class Phantoms:
    """The phantoms of one attack, each with a station id, a clock and a memory of its path of its own.

    A phantom checks every 0.1 s whether it has to send, as any station does, and leaves through the antenna
    of an attacker. length_m, width_m: of each. ahead_s: how much later than it is they are generated; up to
    the expiry of a map, they stay in it so much longer. dcc: whether all messages of an attacker's radio
    together keep to reactive congestion control; each of its phantoms gets the same part.
    """

    def __init__(
        self, context: AttackContext, *, length_m: float, width_m: float, ahead_s: float, dcc: bool
    ) -> None:
        self._context = context
        self.length_m = float(checked_number(context.name, "length_m", length_m, 0.1, 100))
        self._width_m = float(checked_number(context.name, "width_m", width_m, 0.1, 6))
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._rules = GenerationRules.of(context.v2x.cam)
        self._gate = Gate(context.v2x, context.attackers) if dcc else None
        self._stations: dict[Key, _Station] = {}

    def tell(self, step: V2xStep, sender: int, motions: Mapping[Key, GhostMotion]) -> list[Sent]:
        """What these phantoms have an attacker's radio send in this step, while the attack is active.

        Keys name phantoms for all the drive; the first call with one switches it on.
        """
        if step.end_ns is None or not motions:
            return []
        interval_s = 0.0 if self._gate is None else self._gate.interval_s(sender) * len(motions)
        poses: Float64 = np.array([motion.map_SE3_base for motion in motions.values()])
        places = reference_points(self._context.geodesy, poses, np.full(len(motions), self.length_m))
        sent: list[Sent] = []
        for (key, motion), place in zip(motions.items(), places, strict=True):
            station = self._station(step, key)
            state = self._state(step.begin_ns, station.id, motion, place)
            while station.next_check_ns < step.end_ns:
                at_ns, station.next_check_ns = (
                    station.next_check_ns,
                    station.next_check_ns + CHECK_INTERVAL_NS,
                )
                if at_ns < step.begin_ns or not self._context.active(at_ns):
                    continue
                cam = station.generator.check(at_ns, state, interval_s)
                if cam is not None:
                    sent.append(self._context.message(sender, at_ns, cam.payload))
        return sent

    def hear(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Takes all that is sent in the step, for congestion control."""
        if self._gate is not None:
            self._gate.hear(step, sent)

    def _station(self, step: V2xStep, key: Key) -> _Station:
        if key not in self._stations:
            checked_number = self._context.pseudonym("phantom", *key)
            first_ns = first_check_ns(step.begin_ns, self._context.seed, checked_number)
            self._stations[key] = _Station(checked_number, CamGenerator(step.begin_ns, self._rules), first_ns)
        return self._stations[key]

    def _state(
        self, time_ns: int, station_id: int, motion: GhostMotion, place: ReferencePoint
    ) -> StationState:
        believed = self._context.v2x.others
        variance_m2 = believed.position_stddev_m**2
        return own_state(
            Identity(
                station_id, StationType.PASSENGER_CAR, self.length_m, self._width_m, TrailerPresence.NONE
            ),
            time_ns + self._ahead_ns,
            place,
            Accuracy(
                (variance_m2, 0.0, variance_m2),
                altitude_m=None,
                heading_rad=math.radians(believed.heading_stddev_deg),
                speed_mps=believed.speed_stddev_mps,
                yaw_rate_radps=None,
            ),
            speed_mps=motion.speed_mps,
            acceleration_mps2=motion.acceleration_mps2,
            yaw_rate_radps=motion.yaw_rate_radps,
        )


class PhantomAttack(V2xAttack):
    """An attack by phantoms, which take the last four parameters; see there."""

    def __init__(
        self,
        context: AttackContext,
        *,
        length_m: float = 4.5,
        width_m: float = 1.8,
        ahead_s: float = 0.0,
        dcc: bool = False,
    ) -> None:
        super().__init__(context)
        self._phantoms = Phantoms(context, length_m=length_m, width_m=width_m, ahead_s=ahead_s, dcc=dcc)


class Companion:
    """A place that moves with a vehicle, at a constant offset in its frame, and so turns with it."""

    def __init__(self, offset_m: tuple[float, float]) -> None:
        self._offset_m = np.array([*offset_m, 0.0])
        self._before: tuple[int, float, float] | None = None

    def motion(self, step: V2xStep, radio: RadioPlace) -> GhostMotion:
        """Where the place is, and how it moves; call it in each step in which the vehicle is on the road."""
        pose = radio.map_SE3_base.copy()
        pose[:3, 3] = transform_points(radio.map_SE3_base, self._offset_m)
        yaw_rad, yaw_rate_radps, acceleration_mps2 = yaw_of(pose), 0.0, 0.0
        elapsed_s = 0.0
        if self._before is not None:
            elapsed_s = (step.begin_ns - self._before[0]) / 1e9
            yaw_rate_radps = float(wrap_angle(yaw_rad - self._before[1])) / elapsed_s
        # Velocity of a point of a body that turns: of the two horizontal parts of the offset, the one to
        # the left changes its speed along the heading.
        forward_mps = float(radio.map_SE3_base[:3, 0] @ radio.velocity_mps)
        speed_mps = forward_mps - yaw_rate_radps * float(self._offset_m[1])
        if self._before is not None:
            acceleration_mps2 = (speed_mps - self._before[2]) / elapsed_s
        self._before = step.begin_ns, yaw_rad, speed_mps
        return GhostMotion(pose, speed_mps, acceleration_mps2, yaw_rate_radps)


class Braking(NamedTuple):
    """A straight drive from a pose: at one speed for a while, then braking evenly down to another."""

    map_SE3_start: Float64
    begin_ns: int
    speed_mps: float
    cruise_s: float
    deceleration_mps2: float
    final_mps: float

    def motion(self, time_ns: int) -> GhostMotion:
        """At a time after the begin."""
        passed_s = (time_ns - self.begin_ns) / 1e9
        is_braking = 0 <= passed_s - self.cruise_s < self._stop_s
        braking_s = min(max(passed_s - self.cruise_s, 0.0), self._stop_s)
        after_s = max(passed_s - self.cruise_s - self._stop_s, 0.0)
        way_m = self.speed_mps * (min(passed_s, self.cruise_s) + braking_s)
        way_m += self.final_mps * after_s - self.deceleration_mps2 * braking_s**2 / 2
        pose = self.map_SE3_start.copy()
        pose[:3, 3] += way_m * pose[:3, 0]
        speed_mps = self.speed_mps - self.deceleration_mps2 * braking_s
        return GhostMotion(pose, speed_mps, -self.deceleration_mps2 if is_braking else 0.0, 0.0)

    @property
    def _stop_s(self) -> float:
        return max(self.speed_mps - self.final_mps, 0.0) / self.deceleration_mps2
