"""Falsified positions: VeReMi's attacks 1, 2, 4 and 8, and later ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.message_quantities import POSITION_OFFSET
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.bounds import checked_number, checked_range
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import REFERENCE_POINT_M, OwnMessage, PositionFalsification

_FAR_M = 1e6
_LEAST_SIDE_M = 200.0


class _SamplingArea:
    """The area of random places: a rectangle of the map, or the bounding box of the first step's radios."""

    def __init__(self, attack: str, corners_m: Sequence[float | None] = ()) -> None:
        corners = [corner for corner in corners_m if corner is not None]
        if corners and len(corners) < 4:
            raise UsageError(f"{attack}: give all of x_min_m, x_max_m, y_min_m and y_max_m, or none")
        self._x_m = self._y_m = 0.0, 0.0
        self._is_set = bool(corners)
        if corners:
            self._x_m = checked_range(attack, "x_{}_m", corners[0], corners[1], -_FAR_M, _FAR_M)
            self._y_m = checked_range(attack, "y_{}_m", corners[2], corners[3], -_FAR_M, _FAR_M)

    def set_from(self, step: V2xStep) -> None:
        """Set the area from the first step with radios, if it is not given."""
        if self._is_set or not step.radios:
            return
        places_m = np.array([radio.map_SE3_base[:2, 3] for radio in step.radios])
        low_m, high_m = places_m.min(axis=0), places_m.max(axis=0)
        wider_m = np.maximum(_LEAST_SIDE_M - (high_m - low_m), 0) / 2
        self._x_m, self._y_m = np.stack([low_m - wider_m, high_m + wider_m], axis=1).tolist()
        self._is_set = True

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """A uniform random place: x and y."""
        return float(rng.uniform(self._x_m[0], self._x_m[1])), float(rng.uniform(self._y_m[0], self._y_m[1]))


class PositionConstant(PositionFalsification):
    """Always claims the same position: x_m and y_m in the map's frame (VeReMi 1), or one that each attacker
    draws (F2MD 1) from the bounding box of all radios in the drive's first step, at least 200 m wide."""

    traits = V2xTraits(untrue=("position",), published=Published(veremi_2018=1, veremi_extension=1))

    def __init__(
        self,
        context: AttackContext,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
        rebuild_path: bool = True,
    ) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        if (x_m is None) != (y_m is None):
            raise UsageError(f"{context.name}: give both x_m and y_m, or none")
        self._place_m = None if x_m is None or y_m is None else (x_m, y_m)
        if self._place_m is not None:
            for name, value in zip(("x_m", "y_m"), self._place_m, strict=True):
                checked_number(context.name, name, value, -_FAR_M, _FAR_M)
        self._area, self._draws = _SamplingArea(context.name), AttackDraws(context)
        self._places_m: dict[int, tuple[float, float]] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        self._area.set_from(step)
        return super().edit(step, sent)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if self._place_m is None and station_id not in self._places_m:
            self._places_m[station_id] = self._area.draw(self._draws.of(station_id))
        return {REFERENCE_POINT_M: self._place_m or self._places_m[station_id]}


class PositionOffset(PositionFalsification):
    """The true position plus a constant offset.

    x_m, y_m: of all attackers (VeReMi 2: 250, -150). Without them, each attacker draws both between min_m and
    max_m, with random signs: NextGen's 20 to 70 m; F2MD's 70 m +- 55 % are 31.5 to 108.5 m.
    """

    traits = V2xTraits(
        untrue=("position",),
        published=Published(veremi_2018=2, veremi_extension=2, nextgen=1, catch_f1=0.846),
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        x_m: float | None = None,
        y_m: float | None = None,
        min_m: float = 20.0,
        max_m: float = 70.0,
        rebuild_path: bool = True,
    ) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        least_m, most_m = checked_range(context.name, "{}_m", min_m, max_m, 0, _FAR_M)
        for name, value in (("x_m", x_m), ("y_m", y_m)):
            if value is not None:
                checked_number(context.name, name, value, -_FAR_M, _FAR_M)
        draws = AttackDraws(context)
        drawn_m = {
            attacker: tuple(draws.signed(attacker, least_m, most_m) for _ in range(2))
            for attacker in context.attackers
        }
        if x_m is not None or y_m is not None:
            drawn_m = dict.fromkeys(drawn_m, (x_m or 0.0, y_m or 0.0))
        self._offsets_m = drawn_m

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        corner_m = parameters["x_m"], parameters["y_m"]
        if corner_m == (None, None):
            corner_m = parameters["max_m"], parameters["max_m"]
        return {POSITION_OFFSET.name: (0, math.hypot(corner_m[0] or 0, corner_m[1] or 0))}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        offset_m = self._offsets_m[message.station_id]
        return {
            REFERENCE_POINT_M: (
                message.reference_point_m[0] + offset_m[0],
                message.reference_point_m[1] + offset_m[1],
            )
        }


class PositionRandom(PositionFalsification):
    """A random position in each message (VeReMi 4, F2MD 3), uniform in a rectangle of the map.

    x_min_m to y_max_m: the rectangle; by default the bounding box of all radios in the drive's first step, at
    least 200 m wide.
    """

    traits = V2xTraits(untrue=("position",), published=Published(veremi_2018=4, veremi_extension=3))

    def __init__(
        self,
        context: AttackContext,
        *,
        x_min_m: float | None = None,
        x_max_m: float | None = None,
        y_min_m: float | None = None,
        y_max_m: float | None = None,
        rebuild_path: bool = True,
    ) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._area = _SamplingArea(context.name, (x_min_m, x_max_m, y_min_m, y_max_m))
        self._draws = AttackDraws(context)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        self._area.set_from(step)
        return super().edit(step, sent)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        return {REFERENCE_POINT_M: self._area.draw(self._draws.of(message.station_id))}


class PositionRandomOffset(PositionFalsification):
    """The true position plus a random offset in each message: between min_m and max_m along each axis, with
    random signs. NextGen's 20 to 70 m; VeReMi 8 has 0 to 300 m, F2MD 4 0 to 35 m."""

    traits = V2xTraits(
        untrue=("position",), published=Published(veremi_2018=8, veremi_extension=4, nextgen=2, catch_f1=0.94)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        min_m: float = 20.0,
        max_m: float = 70.0,
        rebuild_path: bool = True,
    ) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._span_m = checked_range(context.name, "{}_m", min_m, max_m, 0, _FAR_M)
        self._draws = AttackDraws(context)

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        return {POSITION_OFFSET.name: (0, math.hypot(parameters["max_m"], parameters["max_m"]))}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        east_m, north_m = (self._draws.signed(message.station_id, *self._span_m) for _ in range(2))
        return {
            REFERENCE_POINT_M: (message.reference_point_m[0] + east_m, message.reference_point_m[1] + north_m)
        }


class PositionMirrored(PositionFalsification):
    """A position on the opposite side of the road: left_m to the left of the heading (negative: to the right,
    for left-hand traffic). NextGen's distance depends on the road."""

    traits = V2xTraits(
        untrue=("position",),
        published=Published(nextgen=3, catch_f1=0.192),
        published_of={"preset": "nextgen"},
    )

    def __init__(self, context: AttackContext, *, left_m: float = 3.5, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._left_m = checked_number(context.name, "left_m", left_m, -1000, 1000)

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        return {POSITION_OFFSET.name: (0, abs(parameters["left_m"]))}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        heading_rad = message.field("heading_rad")
        if heading_rad is None:
            return {}
        # Clockwise from north: forward is (sin, cos), and left of that (-cos, sin).
        x_m = message.reference_point_m[0] - self._left_m * math.cos(heading_rad)
        return {REFERENCE_POINT_M: (x_m, message.reference_point_m[1] + self._left_m * math.sin(heading_rad))}
