"""Lies about where one heads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.labels.declaration import Published
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.falsification import Falsification, OwnMessage


class HeadingReversed(Falsification):
    """The opposite direction, at the same reference point: receivers who place its box behind that point
    see it a length farther on."""

    traits = V2xTraits(untrue=("heading",), published=Published(nextgen=8, catch_f1=0.593))

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return _turned(message, math.pi)


class HeadingRotating(Falsification):
    """A heading that turns away from the truth, clockwise, from the attacker's first lie on."""

    traits = V2xTraits(untrue=("heading",))

    def __init__(self, context: AttackContext, *, rate_degps: float = 45.0) -> None:
        super().__init__(context)
        self._rate_radps = math.radians(checked_number(context.name, "rate_degps", rate_degps, -3600, 3600))
        self._begun_ns: dict[int, int] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        begun_ns = self._begun_ns.setdefault(message.station_id, message.time_ns)
        return _turned(message, self._rate_radps * (message.time_ns - begun_ns) / 1e9)


def _turned(message: OwnMessage, by_rad: float) -> Mapping[str, Any]:
    heading_rad = message.field("heading_rad")
    return {} if heading_rad is None else {"heading_rad": (heading_rad + by_rad) % math.tau}
