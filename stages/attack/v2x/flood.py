"""Denial of service by far more messages than the standard allows, with various contents."""

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
"""Four times the highest rate of the standard, like F2MD's four times the normal rate."""
MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 10_000.0
_LATITUDE_DEG = 1e-4


class Flood(V2xAttack):
    """Sends `rate_hz` messages at equal intervals, besides the attackers' genuine ones.

    ahead_s: how far generation times lie in the future. dcc: whether attackers still respect reactive
    congestion control. sybil: use a new station id for each message.
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
        self._dcc_gate = DccGate(context.v2x, context.attackers) if dcc else None
        self._rngs = {attacker: context.rng("flood", attacker) for attacker in context.attackers}
        self._next_ns = {
            attacker: context.start_ns + int(rng.integers(self._interval_ns))
            for attacker, rng in self._rngs.items()
        }
        self._pseudonyms = 0
        self._state_ns = context.start_ns

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        rate_hz = min(max(parameters["rate_hz"], MIN_RATE_HZ), MAX_RATE_HZ)  # other rates are rejected
        return {MESSAGES_ADDED.name: (0, math.ceil(1e9 / _interval_ns(rate_hz)))}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited = list(sent)
        for attacker in self.context.attackers:
            radio = self.context.radio(step, attacker)
            if radio is not None and step.end_ns is not None:
                self._state_ns = step.begin_ns  # of which stations state positions, whenever they send
                self._prepare(step, radio, sent)
                edited += self._flood_step(attacker, step.begin_ns, step.end_ns)
        self._remember(step, sent)
        if self._dcc_gate is not None:
            self._dcc_gate.observe(step, edited)
        return edited

    def _flood_step(self, attacker: int, begin_ns: int, end_ns: int) -> list[Sent]:
        cams, interval_ns = self.context.cams, self._interval_ns
        if self._dcc_gate is not None:
            interval_ns = max(interval_ns, round(self._dcc_gate.interval_s(attacker) * 1e9))
        at_ns, flooded = self._next_ns[attacker], []
        at_ns += -(-max(begin_ns - at_ns, 0) // interval_ns) * interval_ns
        while at_ns < end_ns:
            tree = self._content(attacker, at_ns) if self.context.active(at_ns) else None
            if tree is not None:
                if self.sybil:
                    self._pseudonyms += 1
                    pseudonym = self.context.pseudonym("flood", attacker, self._pseudonyms)
                    tree = with_fields(tree, station_id=pseudonym)
                if self._ahead_ns:
                    tree = with_later_time(tree, self._ahead_ns)
                flooded.append(self.context.message(attacker, at_ns, cams.close(tree)))
            at_ns += interval_ns
        self._next_ns[attacker] = at_ns
        return flooded

    def _prepare(self, step: V2xStep, radio: RadioPlace, sent: Sequence[Sent]) -> None:
        """Hook before an attacker floods a step."""

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Hook after a step, with the messages that attackers could overhear."""

    @abstractmethod
    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        """The content of a message generated at this time; None to send no message."""


class Dos(Flood):
    """The attacker's own last CAM, extrapolated along its heading: true, but sent too often."""

    traits = V2xTraits(
        every_message_matters=True,
        needs_ticket=False,
        published=Published(veremi_extension=13, nextgen=12, catch_f1=0.353),
        published_of={"preset": "nextgen"},
    )

    def __init__(self, context: AttackContext, **others: Any) -> None:
        super().__init__(context, **others)
        self._own: dict[int, tuple[int, CamTree]] = {}

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        for message in sorted(sent, key=lambda message: (message.request_ns, message.number)):
            if message.station_id in self.context.attackers:
                tree = self.context.cams.open(message.payload)
                if tree is not None:
                    self._own[message.station_id] = message.request_ns, tree

    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        if attacker not in self._own:
            return None
        own_ns, tree = self._own[attacker]
        return extrapolated(tree, at_ns - own_ns)


class DosRandom(Flood):
    """Random positions within extent_m of the attacker, speeds up to speed_max_mps, headings, accelerations.

    All else is as in the attacker's own last CAM, so that no length tells. F2MD's DoS random draws places in
    the whole map and speeds up to 40 m/s.
    """

    traits = V2xTraits(
        every_message_matters=True,
        needs_traffic=False,
        needs_ticket=False,
        published=Published(veremi_extension=14),
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
        self._own: dict[int, CamTree] = {}
        self._axes_deg = (0.0, 0.0)

    def _prepare(self, step: V2xStep, radio: RadioPlace, sent: Sequence[Sent]) -> None:
        latitude_deg, longitude_deg, altitude_m = self.context.geodesy.to_geographic(
            radio.map_SE3_base[:3, 3]
        ).tolist()
        base = Cam(
            station_id=self.context.identities.of(radio.station_id),
            station_type=StationType.PASSENGER_CAR,
            generation_delta_time_ms=0,
            altitude_m=altitude_m,
            drive_direction=DriveDirection.FORWARD,
            length_m=4.5,
            width_m=1.8,
        )
        self._base = self._own.get(radio.station_id, cam_tree(base)), latitude_deg, longitude_deg
        self._axes_deg = degrees_per_metre(latitude_deg, longitude_deg)

    def _remember(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        for message in sorted(sent, key=lambda message: (message.request_ns, message.number)):
            if message.station_id in self.context.attackers:
                tree = self.context.cams.open(message.payload)
                if tree is not None:
                    self._own[message.station_id] = tree

    def _content(self, attacker: int, at_ns: int) -> CamTree | None:
        assert self._base is not None
        tree, latitude_deg, longitude_deg = self._base
        east, north, speed, heading, acceleration = self._rngs[attacker].random(5).tolist()
        per_east_deg, per_north_deg = self._axes_deg
        return with_fields(
            tree,
            station_id=self.context.identities.of(attacker),
            generation_delta_time_ms=generation_delta_time_ms(self._state_ns),
            latitude_deg=latitude_deg + (2 * north - 1) * self._extent_m * per_north_deg,
            longitude_deg=longitude_deg + (2 * east - 1) * self._extent_m * per_east_deg,
            speed_mps=speed * self._speed_max_mps,
            heading_rad=heading * math.tau,
            longitudinal_acceleration_mps2=acceleration * 10 - 5,
        )


class DosRandomSybil(DosRandom):
    """Random positions like `cam-dos-random`, with a new pseudonym in each message."""

    traits = V2xTraits(
        every_message_matters=True,
        needs_traffic=False,
        needs_ticket=False,
        published=Published(veremi_extension=18),
    )

    sybil = True


class DosDisruptive(Flood):
    """Random messages overheard in the last memory_s within range_m, replayed as new under the attacker's
    id."""

    traits = V2xTraits(
        every_message_matters=True,
        needs_traffic=False,
        needs_ticket=False,
        published=Published(veremi_extension=15),
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
        overheard = self._overheard.any_of(attacker, self._rngs[attacker])
        tree = None if overheard is None else self.context.cams.open(overheard.payload)
        if tree is None:
            return None
        return with_fields(
            tree,
            station_id=self.context.identities.of(attacker),
            generation_delta_time_ms=generation_delta_time_ms(self._state_ns),
        )


class DosDisruptiveSybil(DosDisruptive):
    """Replayed messages like `cam-dos-disruptive`, with a new pseudonym in each message."""

    traits = V2xTraits(
        every_message_matters=True,
        needs_traffic=False,
        needs_ticket=False,
        published=Published(veremi_extension=19),
    )

    sybil = True


def _interval_ns(rate_hz: float) -> int:
    return round(1e9 / rate_hz)


def extrapolated(tree: CamTree, by_ns: int) -> CamTree:
    """The CAM of a vehicle after it moved straight on for this long."""
    names = ("latitude_deg", "longitude_deg", "heading_rad", "speed_mps")
    latitude_deg, longitude_deg, heading_rad, speed_mps = (field_of(tree, name) for name in names)
    values = (latitude_deg, longitude_deg, heading_rad, speed_mps)
    if any(value is None or not np.isfinite(value) for value in values):
        return with_later_time(tree, by_ns)
    distance_m = speed_mps * by_ns / 1e9
    per_east_deg, per_north_deg = degrees_per_metre(latitude_deg, longitude_deg)
    moved = with_fields(
        tree,
        latitude_deg=latitude_deg + distance_m * math.cos(heading_rad) * per_north_deg,
        longitude_deg=longitude_deg + distance_m * math.sin(heading_rad) * per_east_deg,
    )
    return with_later_time(moved, by_ns)


def degrees_per_metre(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Degrees of longitude per metre east, and of latitude per metre north; not valid at the poles."""
    east_m, north_m = east_north_m(
        latitude_deg, longitude_deg, latitude_deg + _LATITUDE_DEG, longitude_deg + _LATITUDE_DEG
    )
    return _LATITUDE_DEG / east_m, _LATITUDE_DEG / north_m
