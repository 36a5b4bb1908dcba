"""Falsified speeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.message_quantities import SPEED_OFFSET
from advpipe.stages.attack.bounds import checked_number, checked_range
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import Falsification, OwnMessage

MAX_MPS = 163.81
"""The largest speed that a CAM can encode."""


class SpeedConstant(Falsification):
    """A constant speed: speed_mps (0: NextGen's zero speed report), or one that each attacker draws between
    0 and max_mps (F2MD 5)."""

    traits = V2xTraits(
        untrue=("speed",),
        published=Published(veremi_2018=32, veremi_extension=5, nextgen=6, catch_f1=0.907),
        published_of={"speed_mps": 0.0},
    )

    def __init__(
        self, context: AttackContext, *, speed_mps: float | None = None, max_mps: float = 40.0
    ) -> None:
        super().__init__(context)
        most_mps = checked_number(context.name, "max_mps", max_mps, 0, MAX_MPS)
        draws = AttackDraws(context)
        self._speeds_mps = {
            attacker: float(draws.of(attacker).uniform(0, most_mps))
            if speed_mps is None
            else checked_number(context.name, "speed_mps", speed_mps, 0, MAX_MPS)
            for attacker in context.attackers
        }

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return {"speed_mps": self._speeds_mps[message.station_id]}


class SpeedOffset(Falsification):
    """The true speed plus a constant offset; negative results become zero.

    offset_mps: of all attackers; without it, each attacker draws one with a random sign between min_mps and
    max_mps: NextGen's 1 to 7 m/s; F2MD's 7 m/s +- 55 % are 3.15 to 10.85 m/s.
    """

    traits = V2xTraits(untrue=("speed",), published=Published(veremi_extension=6, nextgen=4, catch_f1=0.637))

    def __init__(
        self,
        context: AttackContext,
        *,
        offset_mps: float | None = None,
        min_mps: float = 1.0,
        max_mps: float = 7.0,
    ) -> None:
        super().__init__(context)
        ends_mps = checked_range(context.name, "{}_mps", min_mps, max_mps, 0, MAX_MPS)
        draws = AttackDraws(context)
        self._offsets_mps = {
            attacker: draws.signed(attacker, *ends_mps)
            if offset_mps is None
            else checked_number(context.name, "offset_mps", offset_mps, -MAX_MPS, MAX_MPS)
            for attacker in context.attackers
        }

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        offset_mps = parameters["offset_mps"]
        return {SPEED_OFFSET.name: (0, parameters["max_mps"] if offset_mps is None else abs(offset_mps))}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return _offset(message, self._offsets_mps[message.station_id])


class SpeedRandom(Falsification):
    """A random speed in each message, uniform between 0 and max_mps (F2MD 7)."""

    traits = V2xTraits(untrue=("speed",), published=Published(veremi_extension=7))

    def __init__(self, context: AttackContext, *, max_mps: float = 40.0) -> None:
        super().__init__(context)
        self._most_mps = checked_number(context.name, "max_mps", max_mps, 0, MAX_MPS)
        self._draws = AttackDraws(context)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return {"speed_mps": float(self._draws.of(message.station_id).uniform(0, self._most_mps))}


class SpeedRandomOffset(Falsification):
    """The true speed plus a random offset in each message, between min_mps and max_mps with a random sign.

    NextGen's 1 to 7 m/s; F2MD 8 has up to 7 m/s +- 55 %. Negative results become zero.
    """

    traits = V2xTraits(
        untrue=("speed",), published=Published(veremi_2018=64, veremi_extension=8, nextgen=5, catch_f1=0.808)
    )

    def __init__(self, context: AttackContext, *, min_mps: float = 1.0, max_mps: float = 7.0) -> None:
        super().__init__(context)
        self._ends_mps = checked_range(context.name, "{}_mps", min_mps, max_mps, 0, MAX_MPS)
        self._draws = AttackDraws(context)

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        return {SPEED_OFFSET.name: (0, parameters["max_mps"])}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return _offset(message, self._draws.signed(message.station_id, *self._ends_mps))


class SpeedFrozen(Falsification):
    """Freezes the speed at that of a random message: NextGen's sudden constant speed.

    probability: of freezing at each message.
    """

    traits = V2xTraits(untrue=("speed",), published=Published(nextgen=7, catch_f1=0.284))

    def __init__(self, context: AttackContext, *, probability: float = 0.05) -> None:
        super().__init__(context)
        self._probability = checked_number(context.name, "probability", probability, 0, 1)
        self._draws = AttackDraws(context)
        self._frozen_mps: dict[int, float | None] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id not in self._frozen_mps:
            if self._draws.of(station_id).random() >= self._probability:
                return {}
            self._frozen_mps[station_id] = message.field("speed_mps")
        return {"speed_mps": self._frozen_mps[station_id]}


def _offset(message: OwnMessage, offset_mps: float) -> Mapping[str, Any]:
    speed_mps = message.field("speed_mps")
    return {} if speed_mps is None else {"speed_mps": max(speed_mps + offset_mps, 0.0)}
