"""NextGen's attacks on an attacker's own claims that differ from ours by more than parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.misbehaviour.roads import RoadMap
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.draws import AttackDraws
from advpipe.stages.attack.v2x.falsification import (
    REFERENCE_POINT_M,
    Falsification,
    OwnMessage,
    PositionFalsification,
)
from advpipe.stages.attack.v2x.stop import FROZEN_FIELDS

LANE_M = 3.2
"""The width that its code takes every lane to have."""
STOP_PROBABILITY, FACTOR = 0.05, (2.0, 4.0)
_ALONG, _KERB_M, _REACH_M = math.cos(math.radians(30)), 1.0, 40.0
_ACCELERATION = "longitudinal_acceleration_mps2"


class NextgenMirrored(PositionFalsification):
    """A position to the left: as far as the left edge of the lanes in the direction of travel, and half of
    the width that these have at 3.2 m each.

    The true position where there is no lane.
    """

    traits = V2xTraits(
        untrue=("position",), every_message_matters=True, published=Published(nextgen=3, catch_f1=0.192)
    )

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        heading_rad, roads = message.field("heading_rad"), self.context.roads()
        if heading_rad is None or roads is None:
            return {}
        x_m, y_m = message.reference_point_m
        edge_m, lanes = carriageway(roads, (x_m, y_m), math.pi / 2 - heading_rad)
        if not lanes:
            return {}
        left_m = abs(edge_m) + lanes * LANE_M / 2
        moved_m = x_m - left_m * math.cos(heading_rad), y_m + left_m * math.sin(heading_rad)
        return {REFERENCE_POINT_M: moved_m}


def carriageway(roads: RoadMap, place_m: tuple[float, float], yaw_rad: float) -> tuple[float, int]:
    """How far to the left of a place its lanes in this direction end, and how many side by side there are; no
    lanes where the place is on none."""
    if not np.isfinite(place_m).all() or not len(roads.segments_m):
        return 0.0, 0
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    left = np.array([-ahead[1], ahead[0]])
    begins, ends = (roads.segments_m[:, end] - place_m for end in (0, 1))
    along = ends - begins
    crosses = (begins @ ahead <= 0) & (ends @ ahead > 0)
    crosses &= along @ ahead > _ALONG * np.linalg.norm(along, axis=1)
    (found,) = np.nonzero(crosses)
    share = -(begins[found] @ ahead) / (along[found] @ ahead)
    lateral_m = begins[found] @ left + share * (along[found] @ left)
    near = np.abs(lateral_m) < _REACH_M
    half_m = roads.widths_m[found][near] / 2
    lateral_m = lateral_m[near]
    if not len(lateral_m) or (np.abs(lateral_m) - half_m).min() > _KERB_M:
        return 0.0, 0
    order = np.argsort(lateral_m)
    lateral_m, half_m = lateral_m[order], half_m[order]
    own = int(np.argmin(np.abs(lateral_m)))
    first = last = own
    edges_m = lateral_m - half_m, lateral_m + half_m
    while last + 1 < len(lateral_m) and edges_m[0][last + 1] - edges_m[1][last] < _KERB_M:
        last += 1
    while first > 0 and edges_m[0][first] - edges_m[1][first - 1] < _KERB_M:
        first -= 1
    return float(edges_m[1][last]), last - first + 1


class NextgenStop(PositionFalsification):
    """Claims to stand at the place of a random message from that message on.

    It stops with a probability of 0.05 at each message; there, too, speed and acceleration are zero.
    """

    traits = V2xTraits(
        untrue=("position", "speed", "heading", "acceleration"),
        published=Published(nextgen=14, catch_f1=0.029),
    )

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context, rebuild_path=rebuild_path)
        self._draws = AttackDraws(context)
        self._stopped: dict[int, dict[str, Any]] = {}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        station_id = message.station_id
        if station_id not in self._stopped:
            if self._draws.of(station_id).random() >= STOP_PROBABILITY:
                return {}
            standing = {"speed_mps": 0.0, _ACCELERATION: 0.0}
            self._stopped[station_id] = {name: message.field(name) for name in FROZEN_FIELDS} | standing
        return self._stopped[station_id]


class NextgenFeignedBraking(Falsification):
    """The acceleration of a message that states a positive one, times a negative factor, -2 to -4 by
    attacker.

    Nothing else changes.
    """

    traits = V2xTraits(untrue=("acceleration",), published=Published(nextgen=9, catch_f1=0.027))

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        draws = AttackDraws(context)
        self._factors = {one: float(draws.of(one).uniform(*FACTOR)) for one in context.attackers}

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        true_mps2 = message.field(_ACCELERATION)
        if true_mps2 is None or true_mps2 <= 0:
            return {}
        return {_ACCELERATION: -true_mps2 * self._factors[message.station_id]}
