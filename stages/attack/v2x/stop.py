"""Falsified stops: vehicles that claim to have stopped but drive on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.v2x.codec.codes import AccelerationControl
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import OwnMessage, PositionFalsification

FROZEN_FIELDS = ("latitude_deg", "longitude_deg", "altitude_m", "heading_rad")
_STANDSTILL: dict[str, Any] = {
    "speed_mps": 0.0,
    "longitudinal_acceleration_mps2": 0.0,
    "yaw_rate_radps": 0.0,
    "curvature_per_m": 0.0,
}
EMERGENCY_MPS2 = -8.0


class EventualStop(PositionFalsification):
    """Claims to stand at the place of a random message from that message on.

    probability: of stopping at the first message; growth: added to it with each later message. VeReMi's
    grows, too, and changes the position alone; F2MD's does not grow.
    """

    traits = V2xTraits(
        untrue=(
            "position",
            "speed",
            "heading",
            "turning",
            "acceleration",
        ),
        published=Published(veremi_2018=16, veremi_extension=9),
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        probability: float = 0.025,
        growth: float = 0.025,
        rebuild_path: bool = True,
    ) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._probability = checked_number(context.name, "probability", probability, 0, 1)
        self._growth = checked_number(context.name, "growth", growth, 0, 1)
        self._draws = AttackDraws(context)
        self._message_counts: dict[int, int] = {}
        self._stopped: dict[int, dict[str, Any]] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id in self._stopped:
            return self._stopped[station_id]
        count = self._message_counts.get(station_id, 0)
        self._message_counts[station_id] = count + 1
        if self._draws.of(station_id).random() >= self._probability + count * self._growth:
            return {}
        self._stopped[station_id] = {name: message.field(name) for name in FROZEN_FIELDS} | _STANDSTILL
        return self._first(self._stopped[station_id])

    def _first(self, stopped: dict[str, Any]) -> Mapping[str, Any]:
        """The fields of the first message of the stop."""
        return stopped


class SuddenStop(EventualStop):
    """Claims to stop from one message to the next, after emergency braking: NextGen's sudden stop.

    probability: of stopping at each message.
    """

    traits = V2xTraits(
        untrue=(
            "position",
            "speed",
            "heading",
            "turning",
            "acceleration",
        ),
        published=Published(nextgen=14, catch_f1=0.029),
        published_of={"preset": "nextgen"},
    )

    def __init__(
        self, context: AttackContext, *, probability: float = 0.05, rebuild_path: bool = True
    ) -> None:
        super().__init__(context, probability=probability, growth=0.0, rebuild_path=rebuild_path)

    def _first(self, stopped: dict[str, Any]) -> Mapping[str, Any]:
        pedals = AccelerationControl.BRAKE_PEDAL | AccelerationControl.EMERGENCY_BRAKE
        braking = {"longitudinal_acceleration_mps2": EMERGENCY_MPS2, "acceleration_control": pedals}
        return stopped | braking
