"""Falsified acceleration and braking; CAMs encode magnitudes beyond 16 m/s2 as 16."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.v2x.codec.codes import AccelerationControl
from advpipe.stages.attack.bounds import checked_number, checked_range
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import Falsification, OwnMessage

_FIELD = "longitudinal_acceleration_mps2"


class Acceleration(Falsification):
    """Multiplies the acceleration by a factor that each attacker draws: 2 to 4, as in NextGen."""

    traits = V2xTraits(untrue=("acceleration",), published=Published(nextgen=10, catch_f1=0.05))

    def __init__(self, context: AttackContext, *, factor_min: float = 2.0, factor_max: float = 4.0) -> None:
        super().__init__(context)
        self._factors = _factors(context, factor_min, factor_max)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        true_mps2 = message.field(_FIELD)
        return {} if true_mps2 is None else {_FIELD: true_mps2 * self._factors[message.station_id]}


class FeignedBraking(Falsification):
    """Claims to brake, with the brake pedal pressed, while it does not.

    The deceleration is the magnitude of the acceleration times a factor that each attacker draws (as in
    NextGen), and at least least_mps2, as NextGen's factor has no effect at constant speed.
    """

    traits = V2xTraits(
        untrue=("acceleration",),
        published=Published(nextgen=9, catch_f1=0.027),
        published_of={"preset": "nextgen"},
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        factor_min: float = 2.0,
        factor_max: float = 4.0,
        least_mps2: float = 3.0,
    ) -> None:
        super().__init__(context)
        self._factors = _factors(context, factor_min, factor_max)
        self._least_mps2 = checked_number(context.name, "least_mps2", least_mps2, 0, 16)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        true_mps2 = message.field(_FIELD) or 0.0
        braking_mps2 = max(abs(true_mps2) * self._factors[message.station_id], self._least_mps2)
        pedals = AccelerationControl(message.field("acceleration_control") or 0)
        pedals = pedals & ~AccelerationControl.GAS_PEDAL | AccelerationControl.BRAKE_PEDAL
        return {_FIELD: -braking_mps2, "acceleration_control": pedals}


def _factors(context: AttackContext, least: float, most: float) -> dict[int, float]:
    ends, draws = checked_range(context.name, "factor_{}", least, most, 0, 1000), AttackDraws(context)
    return {attacker: float(draws.of(attacker).uniform(*ends)) for attacker in context.attackers}
