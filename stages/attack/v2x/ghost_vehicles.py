"""Ghost vehicles: they do not exist, but send consistent CAMs whenever the standard triggers one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
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
from advpipe.stages.attack.v2x.ghost_motion import GhostMotion
from advpipe.stages.attack.v2x.ghost_past import PastPose

Key = tuple[int, ...]


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

    def messages(
        self,
        step: V2xStep,
        sender: int,
        motions: Mapping[Key, GhostMotion],
        pasts: Mapping[Key, Sequence[PastPose]] = MappingProxyType({}),
    ) -> list[Sent]:
        """The messages of these ghost vehicles that an attacker's radio sends in this step while active.

        A key identifies a ghost vehicle throughout the drive; its first use switches the vehicle on. pasts:
        where those that are new claim to have been before, oldest first.
        """
        if step.end_ns is None or not motions:
            return []
        interval_s = 0.0 if self._dcc_gate is None else self._dcc_gate.interval_s(sender) * len(motions)
        poses: Float64 = np.array([motion.map_SE3_base for motion in motions.values()])
        places = reference_points(self._context.geodesy, poses, np.full(len(motions), self.length_m))
        sent: list[Sent] = []
        for (key, motion), place in zip(motions.items(), places, strict=True):
            station = self._station(step, key, pasts.get(key, ()))
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

    def _station(self, step: V2xStep, key: Key, past: Sequence[PastPose]) -> _GhostStation:
        if key not in self._stations:
            station_id = self._context.pseudonym("phantom", *key)
            first_ns = first_check_ns(step.begin_ns, self._context.seed, station_id)
            generator = CamGenerator(step.begin_ns, self._rules)
            if past:
                poses: Float64 = np.array([pose.map_SE3_base for pose in past])
                places = reference_points(self._context.geodesy, poses, np.full(len(past), self.length_m))
                for pose, place in zip(past, places, strict=True):
                    generator.remember(pose.time_ns + self._ahead_ns, place)
            self._stations[key] = _GhostStation(station_id, generator, first_ns)
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
