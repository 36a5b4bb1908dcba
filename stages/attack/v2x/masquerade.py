"""One's own messages under the station id of somebody else."""

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
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M, is_time_untrue, with_later_time

IDENTITIES = ("nearest", "random", "each", "victim")


class Masquerade(V2xAttack):
    """Says what is true of the attacker as if it were another station, whose entry in maps it overwrites.

    identity: the nearest station, or a random one, while it stays within range_m; a random one for each
    message; or the victim itself. ahead_s: generated so much later than it was, so that maps that keep the
    newest CAM prefer it to the true ones.
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
            raise UsageError(f"{context.name}: identity is 'victim', but there is none; name one")
        self._range_m = checked_number(context.name, "range_m", range_m, 0)
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._masks: dict[int, int] = {}
        self._rngs = {attacker: context.rng("masquerade", attacker) for attacker in context.attackers}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        return tuple(
            claim
            for claim in super().untrue(parameters)
            if claim != "generation time" or is_time_untrue(parameters)
        )

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda one: (one.request_ns, one.number))
        return [self._masked(step, one) if self.context.acts(one) else one for one in in_order]

    def _masked(self, step: V2xStep, one: Sent) -> Sent:
        cams = self.context.cams
        tree = cams.open(one.payload)
        mask = self._mask(step, one.station_id)
        if tree is None or mask is None:
            return one
        tree = with_later_time(with_fields(tree, station_id=mask), self._ahead_ns)
        return replace(one, payload=cams.close(tree))

    def _mask(self, step: V2xStep, attacker: int) -> int | None:
        """Whose id the attacker uses; None where nobody is near."""
        if self._identity == "victim":
            return self.context.victim
        others_m = self._others_m(step, attacker)
        mask = self._masks.get(attacker)
        if self._identity == "each" or mask not in others_m:
            if not others_m:
                return None
            ids = sorted(others_m, key=lambda station: (others_m[station], station))
            rng: np.random.Generator = self._rngs[attacker]
            mask = ids[0] if self._identity == "nearest" else ids[int(rng.integers(len(ids)))]
            self._masks[attacker] = mask
        return mask

    def _others_m(self, step: V2xStep, attacker: int) -> dict[int, float]:
        """Stations within range, attackers not, with their distances."""
        own = self.context.radio(step, attacker)
        if own is None:
            return {}
        distances_m = {
            radio.station_id: math.dist(radio.map_SE3_base[:3, 3], own.map_SE3_base[:3, 3])
            for radio in step.radios
            if radio.station_id not in self.context.attackers
        }
        return {station: far_m for station, far_m in distances_m.items() if far_m <= self._range_m}
