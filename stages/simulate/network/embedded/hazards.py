"""Collisions that threaten vehicles, from the true states of all that are on the road."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.traffic.road_users import RoadUser


class Hazards:
    """The vehicles at one instant, in arrays that all stations share."""

    def __init__(self) -> None:
        self._now_ns: int | None = None
        self._centres_m: Float64 = np.empty((0, 2))
        self._velocities_mps: Float64 = np.empty((0, 2))
        self._sizes_m: Float64 = np.empty((0, 2))

    def update(self, now_ns: int, drivers: Mapping[str, RoadUser]) -> None:
        """Take in all vehicles at this time, unless another station has already done so."""
        if now_ns == self._now_ns:
            return
        users = drivers.values()
        self._now_ns = now_ns
        self._centres_m = np.array([user.position_m[:2] for user in users]).reshape(-1, 2)
        self._velocities_mps = np.array([user.velocity_mps[:2] for user in users]).reshape(-1, 2)
        sizes_m = [(user.variant.length_m, user.variant.width_m) for user in users]
        self._sizes_m = np.array(sizes_m, np.float64).reshape(-1, 2)

    def time_to_collision_s(self, user: RoadUser) -> float:
        """Until a vehicle reaches the next one in the straight strip ahead of it, if both keep their speeds.

        Infinite where there is none, or where it does not come nearer.
        """
        forward = user.map_SE3_base[:2, 0] / np.linalg.norm(user.map_SE3_base[:2, 0])
        apart_m = self._centres_m - user.position_m[:2]
        ahead_m = apart_m @ forward
        aside_m = np.abs(apart_m @ np.array([-forward[1], forward[0]]))
        gap_m = ahead_m - (self._sizes_m[:, 0] + user.variant.length_m) / 2
        closing_mps = (user.velocity_mps[:2] - self._velocities_mps) @ forward
        is_ahead = (aside_m < (self._sizes_m[:, 1] + user.variant.width_m) / 2) & (gap_m > 0)
        meets = is_ahead & (closing_mps > 0)
        return float(np.min(gap_m[meets] / closing_mps[meets], initial=math.inf))
