"""Dropped messages."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of


class Drop(V2xAttack):
    """Drops an attacker's messages: all of them, or those that are most relevant for safety.

    probability: of dropping each message that meets the other conditions. near_m: only while the attacker is
    within this distance of the victim. braking_mps2: only messages that report at least this deceleration.
    """

    traits = V2xTraits(needs_ticket=False)

    def __init__(
        self,
        context: AttackContext,
        *,
        probability: float = 1.0,
        near_m: float | None = None,
        braking_mps2: float | None = None,
    ) -> None:
        super().__init__(context)
        name = context.name
        self._probability = checked_number(name, "probability", probability, 0, 1)
        self._near_m = None if near_m is None else checked_number(name, "near_m", near_m, 0)
        self._braking_mps2 = (
            None if braking_mps2 is None else checked_number(name, "braking_mps2", braking_mps2, 0)
        )
        if near_m is not None and context.victim is None:
            raise UsageError(f"{name}: near_m is a distance to the victim; name one")
        self._rngs: dict[int, np.random.Generator] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        return [
            message
            for message in in_order
            if not (self.context.acts(message) and self._is_dropped(step, message))
        ]

    def _is_dropped(self, step: V2xStep, message: Sent) -> bool:
        if self._near_m is not None and not self._distance_m(step, message.station_id) <= self._near_m:
            return False
        if self._braking_mps2 is not None and not self._acceleration_mps2(message) <= -self._braking_mps2:
            return False
        if message.station_id not in self._rngs:
            self._rngs[message.station_id] = self.context.rng("drop", message.station_id)
        return bool(self._rngs[message.station_id].random() < self._probability)

    def _distance_m(self, step: V2xStep, attacker: int) -> float:
        """The distance to the victim; infinite if either is not on the road."""
        assert self.context.victim is not None
        places = [self.context.radio(step, station) for station in (attacker, self.context.victim)]
        if places[0] is None or places[1] is None:
            return math.inf
        return math.dist(places[0].map_SE3_base[:3, 3], places[1].map_SE3_base[:3, 3])

    def _acceleration_mps2(self, message: Sent) -> float:
        tree = self.context.cams.open(message.payload)
        true_mps2 = None if tree is None else field_of(tree, "longitudinal_acceleration_mps2")
        return math.inf if true_mps2 is None else float(true_mps2)
