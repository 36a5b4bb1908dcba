"""Impersonation: the attacker's own messages under the station id of another station."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.claims import Claim
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.bounds import checked_choice, checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import with_fields
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M, with_later_time, without_true_time

IDENTITIES = ("nearest", "random", "each", "victim")


class Masquerade(V2xAttack):
    """Sends the attacker's true state under the id of another station, whose entry in LDMs it overwrites.

    identity: impersonate the "nearest" station or a "random" one while it stays within range_m, a random one
    for "each" message, or the "victim". ahead_s: how far generation times lie in the future, so that LDMs
    that keep the newest CAM prefer it to the genuine ones.
    """

    traits = V2xTraits(untrue=("station id", "generation time"), every_message_matters=True)

    def __init__(
        self,
        context: AttackContext,
        *,
        identity: str = "nearest",
        range_m: float = RECEPTION_RANGE_M,
        ahead_s: float = 0.0,
    ) -> None:
        super().__init__(context)
        self._identity = checked_choice(context.name, "identity", identity, IDENTITIES)
        if identity == "victim" and context.victim is None:
            raise UsageError(f"{context.name}: identity is 'victim', but no victim is given; name one")
        self._range_m = checked_number(context.name, "range_m", range_m, 0)
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._impersonated: dict[int, int] = {}
        self._rngs = {attacker: context.rng("masquerade", attacker) for attacker in context.attackers}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        return without_true_time(super().untrue(parameters), parameters)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        return [
            self._impersonate(step, message) if self.context.acts(message) else message
            for message in in_order
        ]

    def _impersonate(self, step: V2xStep, message: Sent) -> Sent:
        cams = self.context.cams
        tree = cams.open(message.payload)
        station_id = self._identity_of(step, message.station_id)
        if tree is None or station_id is None:
            return message
        tree = with_later_time(
            with_fields(tree, station_id=self.context.identities.of(station_id)), self._ahead_ns
        )
        return replace(message, payload=cams.close(tree))

    def _identity_of(self, step: V2xStep, attacker: int) -> int | None:
        """The station id that the attacker uses; None if no station is in range."""
        if self._identity == "victim":
            return self.context.victim
        others_m = self._others_m(step, attacker)
        station_id = self._impersonated.get(attacker)
        if self._identity == "each" or station_id not in others_m:
            if not others_m:
                return None
            ids = sorted(others_m, key=lambda station: (others_m[station], station))
            rng: np.random.Generator = self._rngs[attacker]
            station_id = ids[0] if self._identity == "nearest" else ids[int(rng.integers(len(ids)))]
            self._impersonated[attacker] = station_id
        return station_id

    def _others_m(self, step: V2xStep, attacker: int) -> dict[int, float]:
        """Stations within range that are not attackers, with their distances."""
        own = self.context.radio(step, attacker)
        if own is None:
            return {}
        distances_m = {
            radio.station_id: math.dist(radio.map_SE3_base[:3, 3], own.map_SE3_base[:3, 3])
            for radio in step.radios
            if radio.station_id not in self.context.attackers
        }
        return {station: far_m for station, far_m in distances_m.items() if far_m <= self._range_m}
