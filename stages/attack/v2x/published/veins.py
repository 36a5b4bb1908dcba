"""The frame and the vectors of Veins, in which VeReMi and F2MD write their messages.

Its x axis points east and its y axis south, from the north-western corner of the playground.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.v2x.base import AttackContext
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import OwnMessage, PositionFalsification
from advpipe.stages.attack.v2x.speed import MAX_MPS


class Playground:
    """The bounding box of the road network, or of the radios in the first step where a bag has no roads."""

    def __init__(self, context: AttackContext) -> None:
        self._context = context
        self._low_m: tuple[float, float] | None = None
        self._high_m = 0.0, 0.0

    def set_from(self, step: V2xStep) -> None:
        """Find it, in the first step with radios."""
        if self._low_m is not None or not step.radios:
            return
        roads = self._context.roads()
        places_m = np.array([radio.map_SE3_base[:2, 3] for radio in step.radios])
        if roads is not None and len(roads.segments_m):
            places_m = roads.segments_m.reshape(-1, 2)
        low_m, high_m = places_m.min(axis=0).tolist(), places_m.max(axis=0).tolist()
        self._low_m, self._high_m = (low_m[0], low_m[1]), (high_m[0], high_m[1])

    @property
    def origin_m(self) -> tuple[float, float]:
        """Veins' origin in the map: its north-western corner."""
        assert self._low_m is not None
        return self._low_m[0], self._high_m[1]

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """A uniform random place in the map."""
        assert self._low_m is not None
        east, north = rng.random(2).tolist()
        return (
            self._low_m[0] + east * (self._high_m[0] - self._low_m[0]),
            self._low_m[1] + north * (self._high_m[1] - self._low_m[1]),
        )


class PlaygroundFalsification(PositionFalsification):
    """The base of attacks that claim places of the playground."""

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self.playground, self.draws = Playground(context), AttackDraws(context)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        self.playground.set_from(step)
        return super().edit(step, sent)


def with_velocity_offset(message: OwnMessage, east_mps: float, south_mps: float) -> Mapping[str, Any]:
    """The speed of a message after an offset of its velocity, whose direction no CAM states."""
    speed_mps, heading_rad = message.field("speed_mps"), message.field("heading_rad")
    if speed_mps is None or heading_rad is None:
        return {}
    east = speed_mps * math.sin(heading_rad) + east_mps
    north = speed_mps * math.cos(heading_rad) - south_mps
    return {"speed_mps": min(math.hypot(east, north), MAX_MPS)}
