"""Far more messages than the standard allows: denial of service, with content of several kinds."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.message_quantities import MESSAGES_ADDED
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.codec.codes import DriveDirection, StationType
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import cam_tree
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.dcc_gate import DccGate
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M, OverheardMessages, with_later_time

RATE_HZ = 40.0
"""Four times what the standard allows, as F2MD's four times the usual."""
MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 10_000.0
_LATITUDE_DEG = 1e-4


class Flood(V2xAttack):
    """Sends so many messages a second beside those of its stations, evenly, whatever the standard says.

    ahead_s: how much later than it is they are generated. dcc: whether attackers keep to reactive congestion
    control all the same. sybil: a new station id for each message.
    """

    sybil = False

    def __init__(
        self, context: AttackContext, *, rate_hz: float = RATE_HZ, ahead_s: float = 0.0, dcc: bool = False
    ) -> None:
        super().__init__(context)
        self._interval_ns = _interval_ns(
            checked_number(context.name, "rate_hz", rate_hz, MIN_RATE_HZ, MAX_RATE_HZ)
        )
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._gate = DccGate(context.v2x, context.attackers) if dcc else None
        self._rngs = {attacker: context.rng("flood", attacker) for attacker in context.attackers}
        self._next_ns = {
            attacker: context.start_ns + int(rng.integers(self._interval_ns))
            for attacker, rng in self._rngs.items()
        }
        self._disguises = 0

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        rate_hz = min(max(parameters["rate_hz"], MIN_RATE_HZ), MAX_RATE_HZ)  # others are refused
        return {MESSAGES_ADDED.name: (0, math.ceil(1e9 / _interval_ns(rate_hz)))}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited = list(sent)
        for attacker in self.context.attackers:
            radio = self.context.radio(step, attacker)
            if radio is not None and step.end_ns is not None:
                self._prepare(step, radio, sent)
                edited += self._pour(attacker, step.begin_ns, step.end_ns)
        self._remember(step, sent)
        if self._gate is not None:
            self._gate.observe(step, edited)
        return edited

    def _pour(self, attacker: int, begin_ns: int, end_ns: int) -> list[Sent]:
        cams, interval_ns = self.context.cams, self._interval_ns
        if self._gate is not None:
            interval_ns = max(interval_ns, round(self._gate.interval_s(attacker) * 1e9))
        at_ns, poured = self._next_ns[attacker], []
        at_ns += -(-max(begin_ns - at_ns, 0) // interval_ns) * interval_ns
        while at_ns < end_ns:
            tree = self._content(attacker, at_ns) if self.context.active(at_ns) else None
            if tree is not None:
                if self.sybil:
                    self._disguises += 1
                    disguise = self.context.pseudonym("flood", attacker, self._disguises)
                    tree = with_fields(tree, station_id=disguise)
                if self._ahead_ns:
                    tree = with_later_time(tree, self._ahead_ns)
                poured.append(self.context.message(attacker, at_ns, cams.close(tree)))
            at_ns += interval_ns
        self._next_ns[attacker] = at_ns
        return poured

    def _prepare(self, step: V2xStep, radio: RadioPlace, sent: Sequence[Sent]) -> None:
        """What an attacker has to know before it floods a step."""

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """What attackers learn from a step when it is over."""

    @abstractmethod
    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        """What a message says that is generated then; None for nothing to say."""


class Dos(Flood):
    """The attacker's own last CAM, moved on along its heading by its speed: true, but too often."""

    traits = V2xTraits(
        every_message_matters=True, published=Published(veremi_extension=13, nextgen=12, catch_f1=0.353)
    )

    def __init__(self, context: AttackContext, **others: Any) -> None:
        super().__init__(context, **others)
        self._own: dict[int, tuple[int, CamTree]] = {}

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        for one in sorted(sent, key=lambda one: (one.request_ns, one.number)):
            if one.station_id in self.context.attackers:
                tree = self.context.cams.open(one.payload)
                if tree is not None:
                    self._own[one.station_id] = one.request_ns, tree

    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        if attacker not in self._own:
            return None
        own_ns, tree = self._own[attacker]
        return _extrapolated(tree, at_ns - own_ns)


class DosRandom(Flood):
    """Random positions within extent_m of the attacker, speeds up to speed_max_mps, headings, accelerations.

    F2MD's DoS random draws places in the whole map and speeds up to 40 m/s.
    """

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=14)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        extent_m: float = 500.0,
        speed_max_mps: float = 40.0,
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        self._extent_m = checked_number(context.name, "extent_m", extent_m, 0, 20_000)
        self._speed_max_mps = checked_number(context.name, "speed_max_mps", speed_max_mps, 0, 163)
        self._base: tuple[CamTree, float, float] | None = None
        self._axes_deg = (0.0, 0.0)

    def _prepare(self, step: V2xStep, radio: RadioPlace, sent: Sequence[Sent]) -> None:
        latitude_deg, longitude_deg, altitude_m = self.context.geodesy.to_geographic(
            radio.map_SE3_base[:3, 3]
        ).tolist()
        base = Cam(
            station_id=radio.station_id,
            station_type=StationType.PASSENGER_CAR,
            generation_delta_time_ms=0,
            altitude_m=altitude_m,
            drive_direction=DriveDirection.FORWARD,
            length_m=4.5,
            width_m=1.8,
        )
        self._base = cam_tree(base), latitude_deg, longitude_deg
        self._axes_deg = _degrees_per_metre(latitude_deg, longitude_deg)

    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        assert self._base is not None
        tree, latitude_deg, longitude_deg = self._base
        east, north, speed, heading, acceleration = self._rngs[attacker].random(5).tolist()
        per_east_deg, per_north_deg = self._axes_deg
        return with_fields(
            tree,
            generation_delta_time_ms=generation_delta_time_ms(at_ns),
            latitude_deg=latitude_deg + (2 * north - 1) * self._extent_m * per_north_deg,
            longitude_deg=longitude_deg + (2 * east - 1) * self._extent_m * per_east_deg,
            speed_mps=speed * self._speed_max_mps,
            heading_rad=heading * math.tau,
            longitudinal_acceleration_mps2=acceleration * 10 - 5,
        )


class DosRandomSybil(DosRandom):
    """Random positions as of `cam-dos-random`, each message from another station that does not exist."""

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=18)
    )

    sybil = True


class DosDisruptive(Flood):
    """Any message that was heard in the last memory_s within range_m, under the attacker's id, as if new."""

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=15)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        memory_s: float = 10.0,
        range_m: float = RECEPTION_RANGE_M,
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        memory_s = checked_number(context.name, "memory_s", memory_s, 0, 600)
        self._overheard = OverheardMessages(
            context.attackers, checked_number(context.name, "range_m", range_m, 0), memory_s
        )

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        self._overheard.listen(step, sent)

    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        heard = self._overheard.any_of(attacker, self._rngs[attacker])
        tree = None if heard is None else self.context.cams.open(heard.payload)
        if tree is None:
            return None
        return with_fields(
            tree, station_id=attacker, generation_delta_time_ms=generation_delta_time_ms(at_ns)
        )


class DosDisruptiveSybil(DosDisruptive):
    """Repeated messages as of `cam-dos-disruptive`, each from another station that does not exist."""

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=19)
    )

    sybil = True


def _interval_ns(rate_hz: float) -> int:
    return round(1e9 / rate_hz)


def _extrapolated(tree: CamTree, by_ns: int) -> CamTree:
    """A CAM so much later of a vehicle that went straight on."""
    names = ("latitude_deg", "longitude_deg", "heading_rad", "speed_mps")
    latitude_deg, longitude_deg, heading_rad, speed_mps = (field_of(tree, name) for name in names)
    values = (latitude_deg, longitude_deg, heading_rad, speed_mps)
    if any(value is None or not np.isfinite(value) for value in values):
        return with_later_time(tree, by_ns)
    way_m = speed_mps * by_ns / 1e9
    per_east_deg, per_north_deg = _degrees_per_metre(latitude_deg, longitude_deg)
    moved = with_fields(
        tree,
        latitude_deg=latitude_deg + way_m * math.cos(heading_rad) * per_north_deg,
        longitude_deg=longitude_deg + way_m * math.sin(heading_rad) * per_east_deg,
    )
    return with_later_time(moved, by_ns)


def _degrees_per_metre(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Degrees of longitude for a metre to the east, of latitude for one to the north; away from the poles."""
    east_m, north_m = east_north_m(
        latitude_deg, longitude_deg, latitude_deg + _LATITUDE_DEG, longitude_deg + _LATITUDE_DEG
    )
    return _LATITUDE_DEG / east_m, _LATITUDE_DEG / north_m
