"""F2MD's attacks on an attacker's own claims: `MDAttack.cc` with the parameters of `F2MDParameters.h`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import (
    REFERENCE_POINT_M,
    Falsification,
    OwnMessage,
    PositionFalsification,
)
from advpipe.stages.attack.v2x.published.veins import PlaygroundFalsification, with_velocity_offset
from advpipe.stages.attack.v2x.stop import FROZEN_FIELDS

VARIATION = 0.45, 1.55
"""Of most parameters, by attacker."""
OFFSET_M, OFFSET_MPS, SPEED_MPS, STOP_PROBABILITY = 70.0, 7.0, 40.0, 0.05
STALE_MESSAGES = 61
"""One more than its buffer of 60: the newest one in it is the message before the own one."""


class F2mdConstantPosition(PlaygroundFalsification):
    """A place of the playground that each attacker draws."""

    traits = V2xTraits(
        untrue=("position",), every_message_matters=True, published=Published(veremi_extension=1)
    )

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._places_m: dict[int, tuple[float, float]] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id not in self._places_m:
            self._places_m[station_id] = self.playground.draw(self.draws.of(station_id))
        return {REFERENCE_POINT_M: self._places_m[station_id]}


class F2mdPositionOffset(PositionFalsification):
    """70 m +- 55 % along both axes of Veins, which each attacker draws: to the east and to the south."""

    traits = V2xTraits(
        untrue=("position",), every_message_matters=True, published=Published(veremi_extension=2)
    )

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        draws = AttackDraws(context)
        self._offsets_m = {
            attacker: (draws.of(attacker).uniform(*VARIATION, 2) * OFFSET_M).tolist()
            for attacker in context.attackers
        }

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        (x_m, y_m), (east_m, south_m) = message.reference_point_m, self._offsets_m[message.station_id]
        return {REFERENCE_POINT_M: (x_m + east_m, y_m - south_m)}


class F2mdConstantSpeed(Falsification):
    """A velocity that each attacker draws, 0 to 40 m/s along both axes: up to 56.6 m/s."""

    traits = V2xTraits(untrue=("speed",), every_message_matters=True, published=Published(veremi_extension=5))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        draws = AttackDraws(context)
        self._speeds_mps = {
            attacker: math.hypot(*draws.of(attacker).uniform(0, SPEED_MPS, 2).tolist())
            for attacker in context.attackers
        }

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return {"speed_mps": self._speeds_mps[message.station_id]}


class F2mdSpeedOffset(Falsification):
    """7 m/s +- 55 % along both axes of Veins, which each attacker draws: to the east and to the south."""

    traits = V2xTraits(untrue=("speed",), every_message_matters=True, published=Published(veremi_extension=6))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        draws = AttackDraws(context)
        self._offsets_mps = {
            attacker: (draws.of(attacker).uniform(*VARIATION, 2) * OFFSET_MPS).tolist()
            for attacker in context.attackers
        }

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return with_velocity_offset(message, *self._offsets_mps[message.station_id])


class F2mdRandomSpeed(Falsification):
    """A random velocity in each message, 0 to 40 m/s along both axes."""

    traits = V2xTraits(untrue=("speed",), every_message_matters=True, published=Published(veremi_extension=7))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._draws = AttackDraws(context)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        drawn_mps = self._draws.of(message.station_id).uniform(0, SPEED_MPS, 2).tolist()
        return {"speed_mps": math.hypot(*drawn_mps)}


class F2mdRandomSpeedOffset(Falsification):
    """7 m/s +- 55 % along both axes in each message, each with a random sign."""

    traits = V2xTraits(untrue=("speed",), every_message_matters=True, published=Published(veremi_extension=8))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._draws = AttackDraws(context)
        self._ends_mps = VARIATION[0] * OFFSET_MPS, VARIATION[1] * OFFSET_MPS

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        offset_mps = [self._draws.signed(message.station_id, *self._ends_mps) for _ in range(2)]
        return with_velocity_offset(message, *offset_mps)


class F2mdStop(PositionFalsification):
    """Claims to stand at the place of a random message from the next one on.

    Each attacker draws the probability of a stop at each message, 0.05 +- 55 %; it does not grow.
    """

    traits = V2xTraits(
        untrue=("position", "speed", "heading", "acceleration"),
        every_message_matters=True,
        published=Published(veremi_extension=9),
    )

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._draws = AttackDraws(context)
        self._probabilities = {
            attacker: float(self._draws.of(attacker).uniform(*VARIATION)) * STOP_PROBABILITY
            for attacker in context.attackers
        }
        self._stopped: dict[int, dict[str, Any]] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id in self._stopped:
            return self._stopped[station_id]
        if self._draws.of(station_id).random() < self._probabilities[station_id]:
            standing = {"speed_mps": 0.0, "longitudinal_acceleration_mps2": 0.0}
            self._stopped[station_id] = {name: message.field(name) for name in FROZEN_FIELDS} | standing
        return {}


class F2mdStale(PlaygroundFalsification):
    """The own message of 61 messages ago; until there is one, an empty one: at rest in the playground's
    origin.

    Of an empty message, a CAM can state neither length nor width.
    """

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time")),
        every_message_matters=True,
        published=Published(veremi_extension=12),
    )

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context, rebuild_path=False)
        self._past: dict[int, deque[CamTree]] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        return super().edit(step, in_order)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        past = self._past.setdefault(message.station_id, deque(maxlen=STALE_MESSAGES))
        old = past[0] if len(past) == STALE_MESSAGES else None
        past.append(message.tree)
        if old is None:
            nothing = {"speed_mps": 0.0, "longitudinal_acceleration_mps2": 0.0, "heading_rad": math.pi / 2}
            return {REFERENCE_POINT_M: self.playground.origin_m, **nothing}
        return {name: field_of(old, name) for name in _OF_A_BEACON}


_OF_A_BEACON = (
    *("latitude_deg", "longitude_deg", "altitude_m", "heading_rad", "speed_mps"),
    *("longitudinal_acceleration_mps2", "length_m", "width_m"),
)
