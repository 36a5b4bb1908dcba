"""Ghost vehicles: they do not exist, but send consistent CAMs whenever the standard triggers one."""

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
from advpipe.stages.attack.v2x.dcc_gate import DccGate

Key = tuple[int, ...]


class GhostMotion(NamedTuple):
    """The motion of a ghost vehicle at the start of a step; its pose (4, 4) is on the ground, at the middle.

    speed_mps: negative when reversing. acceleration_mps2: forward. yaw_rate_radps: positive to the left.
    """

    map_SE3_base: Float64
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_radps: float


@dataclass
class _GhostStation:
    id: int
    generator: CamGenerator
    next_check_ns: int


class GhostVehicles:
    """The ghost vehicles of one attack, each with its own station id, clock and path history.

    A ghost vehicle checks every 0.1 s whether it has to send, like any station, and an attacker's radio
    transmits its CAMs. length_m, width_m: of each vehicle. ahead_s: how far generation times lie in the
    future, which keeps the vehicles in a receiver's LDM for longer, up to its expiry. dcc: whether all
    messages of an attacker's radio together respect reactive congestion control, in equal shares for its
    ghost vehicles.
    """

    def __init__(
        self, context: AttackContext, *, length_m: float, width_m: float, ahead_s: float, dcc: bool
    ) -> None:
        self._context = context
        self.length_m = float(checked_number(context.name, "length_m", length_m, 0.1, 100))
        self._width_m = float(checked_number(context.name, "width_m", width_m, 0.1, 6))
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._rules = GenerationRules.of(context.v2x.cam)
        self._dcc_gate = DccGate(context.v2x, context.attackers) if dcc else None
        self._stations: dict[Key, _GhostStation] = {}

    def messages(self, step: V2xStep, sender: int, motions: Mapping[Key, GhostMotion]) -> list[Sent]:
        """The messages of these ghost vehicles that an attacker's radio sends in this step while active.

        A key identifies a ghost vehicle throughout the drive; its first use switches the vehicle on.
        """
        if step.end_ns is None or not motions:
            return []
        interval_s = 0.0 if self._dcc_gate is None else self._dcc_gate.interval_s(sender) * len(motions)
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

    def observe(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Update congestion control with everything that is sent in the step."""
        if self._dcc_gate is not None:
            self._dcc_gate.observe(step, sent)

    def _station(self, step: V2xStep, key: Key) -> _GhostStation:
        if key not in self._stations:
            station_id = self._context.pseudonym("phantom", *key)
            first_ns = first_check_ns(step.begin_ns, self._context.seed, station_id)
            self._stations[key] = _GhostStation(
                station_id, CamGenerator(step.begin_ns, self._rules), first_ns
            )
        return self._stations[key]

    def _state(
        self, time_ns: int, station_id: int, motion: GhostMotion, place: ReferencePoint
    ) -> StationState:
        accuracy = self._context.v2x.others
        variance_m2 = accuracy.position_stddev_m**2
        return own_state(
            Identity(
                station_id, StationType.PASSENGER_CAR, self.length_m, self._width_m, TrailerPresence.NONE
            ),
            time_ns + self._ahead_ns,
            place,
            Accuracy(
                (variance_m2, 0.0, variance_m2),
                altitude_m=None,
                heading_rad=math.radians(accuracy.heading_stddev_deg),
                speed_mps=accuracy.speed_stddev_mps,
                yaw_rate_radps=None,
            ),
            speed_mps=motion.speed_mps,
            acceleration_mps2=motion.acceleration_mps2,
            yaw_rate_radps=motion.yaw_rate_radps,
        )


class GhostAttack(V2xAttack):
    """The base of attacks with ghost vehicles; see `GhostVehicles` for the parameters."""

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
        self._ghost_vehicles = GhostVehicles(
            context, length_m=length_m, width_m=width_m, ahead_s=ahead_s, dcc=dcc
        )


class OffsetMotion:
    """The motion of a place at a constant offset in a vehicle's frame, which turns with it."""

    def __init__(self, offset_m: tuple[float, float]) -> None:
        self._offset_m = np.array([*offset_m, 0.0])
        self._before: tuple[int, float, float] | None = None

    def motion(self, step: V2xStep, radio: RadioPlace) -> GhostMotion:
        """The motion in this step; call it in each step in which the vehicle is on the road."""
        pose = radio.map_SE3_base.copy()
        pose[:3, 3] = transform_points(radio.map_SE3_base, self._offset_m)
        yaw_rad, yaw_rate_radps, acceleration_mps2 = yaw_of(pose), 0.0, 0.0
        elapsed_s = 0.0
        if self._before is not None:
            elapsed_s = (step.begin_ns - self._before[0]) / 1e9
            yaw_rate_radps = float(wrap_angle(yaw_rad - self._before[1])) / elapsed_s
        # Velocity of a point of a turning body: only the leftward part of the offset changes its speed along
        # the heading.
        forward_mps = float(radio.map_SE3_base[:3, 0] @ radio.velocity_mps)
        speed_mps = forward_mps - yaw_rate_radps * float(self._offset_m[1])
        if self._before is not None:
            acceleration_mps2 = (speed_mps - self._before[2]) / elapsed_s
        self._before = step.begin_ns, yaw_rad, speed_mps
        return GhostMotion(pose, speed_mps, acceleration_mps2, yaw_rate_radps)


class BrakingMotion(NamedTuple):
    """Straight motion from a pose: constant speed for a while, then constant braking to a final speed."""

    map_SE3_start: Float64
    begin_ns: int
    speed_mps: float
    cruise_s: float
    deceleration_mps2: float
    final_mps: float

    def motion(self, time_ns: int) -> GhostMotion:
        """The motion at a time after the start."""
        elapsed_s = (time_ns - self.begin_ns) / 1e9
        is_braking = 0 <= elapsed_s - self.cruise_s < self._stop_s
        braking_s = min(max(elapsed_s - self.cruise_s, 0.0), self._stop_s)
        after_s = max(elapsed_s - self.cruise_s - self._stop_s, 0.0)
        distance_m = self.speed_mps * (min(elapsed_s, self.cruise_s) + braking_s)
        distance_m += self.final_mps * after_s - self.deceleration_mps2 * braking_s**2 / 2
        pose = self.map_SE3_start.copy()
        pose[:3, 3] += distance_m * pose[:3, 0]
        speed_mps = self.speed_mps - self.deceleration_mps2 * braking_s
        return GhostMotion(pose, speed_mps, -self.deceleration_mps2 if is_braking else 0.0, 0.0)

    @property
    def _stop_s(self) -> float:
        return max(self.speed_mps - self.final_mps, 0.0) / self.deceleration_mps2
