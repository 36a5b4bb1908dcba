"""A vehicle controller: a kinematic bicycle model that follows a lane path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw, wrap_angle, yaw_of
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.lane_path import SPACING_M, LanePath
from advpipe.stages.simulate.traffic.road_users import RoadUser, footprints

LightState = Callable[[str, int], str]
"""The state of a traffic light, by its id, for one of its links, by index: SUMO's letter r, y, g, ..."""

SUBSTEP_S = 0.02
SIGHT_M = 120.0
SIDE_MARGIN_M = 0.3
STOP_BEFORE_M = 1.0
"""Distance kept to a stop line and to the path's end."""

CURVE_MPS2 = 2.0
"""Largest lateral acceleration in curves."""

YELLOW_MPS2 = 3.5
"""A vehicle stops at a yellow light if this deceleration is enough."""

WHEELBASE = 0.6
MAX_STEER_RAD = 0.6


@dataclass(frozen=True)
class Idm:
    """The intelligent driver model: acceleration towards a desired speed, with a gap to the vehicle ahead.

    Treiber, Hennecke and Helbing, "Congested traffic states in empirical observations and microscopic
    simulations", Phys. Rev. E 62 (2000), eqs. 3 and 4; parameters as in Kesting, Treiber and Helbing,
    "Enhanced intelligent driver model ...", Phil. Trans. R. Soc. A 368 (2010), table 1, with a shorter
    time headway for town traffic. `max_braking_mps2` limits braking to the grip of tyres.
    """

    acceleration_mps2: float = 1.4
    braking_mps2: float = 2.0
    headway_s: float = 1.2
    standstill_m: float = 2.0
    exponent: float = 4.0
    max_braking_mps2: float = 8.0

    def __call__(self, speed_mps: float, desired_mps: float, gap_m: float, ahead_mps: float) -> float:
        """Acceleration in m/s2; an infinite gap is a free road."""
        closing_mps = speed_mps - ahead_mps
        reach_mps2 = 2 * np.sqrt(self.acceleration_mps2 * self.braking_mps2)
        desired_gap_m = self.standstill_m + max(
            0.0, speed_mps * self.headway_s + speed_mps * closing_mps / reach_mps2
        )
        free = 1 - (speed_mps / max(desired_mps, 0.1)) ** self.exponent
        acceleration = self.acceleration_mps2 * (free - (desired_gap_m / max(gap_m, 0.1)) ** 2)
        return float(np.clip(acceleration, -self.max_braking_mps2, self.acceleration_mps2))


class Controller:
    """Drives one vehicle along a path, step by step.

    Steering is pure pursuit of a point ahead (Coulter, "Implementation of the pure pursuit path tracking
    algorithm", CMU-RI-TR-92-01, 1992), from the rear axle of a kinematic bicycle (Rajamani, "Vehicle
    dynamics and control", 2012, section 2.2). Height and pitch follow the path. The controller
    keeps its distance from road users on its path, stops at red lights and at the path's end, and slows down
    in curves. At junctions without lights it ignores the right of way, but avoids collisions.
    """

    def __init__(
        self, name: str, variant: Variant, path: LanePath, start: Float64, desired_mps: float
    ) -> None:
        self._name, self._variant, self._path = name, variant, path
        self._wheelbase_m = WHEELBASE * variant.length_m
        self._yaw_rad = yaw_of(start)
        self._rear_m: Float64 = start[:2, 3] - self._wheelbase_m / 2 * self._heading()
        self._speed_mps = self._yaw_rate_radps = 0.0
        self._along_m = float(
            path.along_m[np.argmin(np.linalg.norm(path.places_m[:, :2] - self._rear_m, axis=1))]
        )
        self._idm = Idm()
        self._profile_mps = _speed_profile(path, desired_mps, self._idm.braking_mps2)

    @property
    def path_m(self) -> Float64:
        """The whole path (K, 3)."""
        return self._path.places_m

    def step(self, step_s: float, others: Sequence[RoadUser], light: LightState) -> RoadUser:
        """Advance by `step_s`, given the other road users' current states; return the vehicle's new state."""
        gap_m, ahead_mps = self._nearest_ahead(others)
        stop_m = self._next_stop(light)
        substeps = max(round(step_s / SUBSTEP_S), 1)
        for _ in range(substeps):
            dt_s = step_s / substeps
            before_m = self._along_m
            desired_mps = float(np.interp(before_m, self._path.along_m, self._profile_mps))
            acceleration = min(
                self._idm(self._speed_mps, desired_mps, gap_m, ahead_mps),
                self._idm(self._speed_mps, desired_mps, stop_m, 0.0),
            )
            self._move(acceleration, dt_s)
            gap_m += ahead_mps * dt_s - (self._along_m - before_m)
            stop_m -= self._along_m - before_m
        return self.now()

    def now(self) -> RoadUser:
        """The current state; base_link lies midway between the axles."""
        centre_m = self._rear_m + self._wheelbase_m / 2 * self._heading()
        ends = self._path.at(np.array([self._along_m, self._along_m + self._wheelbase_m]))
        slope = (ends[1, 2] - ends[0, 2]) / self._wheelbase_m
        pose = se3_from_yaw([*centre_m, ends[:, 2].mean()], self._yaw_rad, -float(np.arctan(slope)))
        sideways_mps = self._yaw_rate_radps * self._wheelbase_m / 2
        flat = self._speed_mps * self._heading() + sideways_mps * self._heading()[::-1] * (-1, 1)
        return RoadUser(self._name, self._variant, pose, np.array([*flat, self._speed_mps * slope]))

    def _heading(self) -> Float64:
        return np.array([np.cos(self._yaw_rad), np.sin(self._yaw_rad)])

    def _move(self, acceleration_mps2: float, dt_s: float) -> None:
        speed_mps = max(self._speed_mps + acceleration_mps2 * dt_s, 0.0)
        driven_m = (self._speed_mps + speed_mps) / 2 * dt_s
        lookahead_m = float(np.clip(0.8 * speed_mps, self._wheelbase_m + 1.0, 25.0))
        target = self._path.at(self._along_m + lookahead_m)[:2] - self._rear_m
        alpha = float(wrap_angle(np.arctan2(target[1], target[0]) - self._yaw_rad))
        steer = np.arctan2(2 * self._wheelbase_m * np.sin(alpha), max(float(np.linalg.norm(target)), 0.5))
        steer = float(np.clip(steer, -MAX_STEER_RAD, MAX_STEER_RAD))
        turned_rad = driven_m * np.tan(steer) / self._wheelbase_m
        self._rear_m = self._rear_m + driven_m * np.array(
            [np.cos(self._yaw_rad + turned_rad / 2), np.sin(self._yaw_rad + turned_rad / 2)]
        )
        self._yaw_rad = float(wrap_angle(self._yaw_rad + turned_rad))
        self._speed_mps, self._yaw_rate_radps = speed_mps, turned_rad / dt_s
        window = np.linspace(self._along_m - 1.0, self._along_m + 2.0 + 2 * driven_m, 31)
        places = self._path.at(window)[:, :2]
        nearest_m = window[int(np.argmin(np.linalg.norm(places - self._rear_m, axis=1)))]
        self._along_m = float(np.clip(nearest_m, self._along_m, self._path.along_m[-1]))

    def _front_m(self) -> float:
        return self._along_m + (self._wheelbase_m + self._variant.length_m) / 2

    def _nearest_ahead(self, others: Sequence[RoadUser]) -> tuple[float, float]:
        """Gap to the nearest road user on the path ahead (infinite if there is none), and its speed along
        the path."""
        centre_m = self.now().position_m
        near = [user for user in others if np.linalg.norm(user.position_m - centre_m) < SIGHT_M]
        window = np.arange(self._along_m, min(self._front_m() + SIGHT_M, self._path.along_m[-1]), SPACING_M)
        if not near or len(window) < 2:
            return np.inf, 0.0
        places = self._path.at(window)
        sizes = [(user.variant.length_m, user.variant.width_m) for user in near]
        poses = np.stack([user.map_SE3_base for user in near])
        points = np.concatenate([footprints(poses, np.array(sizes)), poses[:, None, :2, 3]], axis=1)
        apart_m = np.linalg.norm(points[:, :, None] - places[:, :2], axis=-1)  # users, points, places
        nearest = apart_m.argmin(axis=-1)
        gaps_m = window[nearest] - self._front_m()
        on_path = apart_m.min(axis=-1) < self._variant.width_m / 2 + SIDE_MARGIN_M
        on_path &= np.abs(places[nearest, 2] - poses[:, None, 2, 3]) < 3.0
        on_path &= gaps_m.max(axis=1, keepdims=True) > 0  # ignore users wholly beside or behind
        gaps_m = np.where(on_path, gaps_m, np.inf)
        first = int(gaps_m.min(axis=1).argmin())
        gap_m = float(gaps_m[first].min())
        if not np.isfinite(gap_m):
            return np.inf, 0.0
        index = min(int(nearest[first, 4]), len(places) - 2)
        along = places[index + 1] - places[index]
        ahead_mps = float(near[first].velocity_mps @ along / np.linalg.norm(along))
        return max(gap_m, 0.1), max(ahead_mps, 0.0)

    def _next_stop(self, light: LightState) -> float:
        """Distance to the next stop line with a red light, or a yellow one with room to brake, or the
        path's end."""
        distance_m = self._path.along_m[-1] - self._front_m() - STOP_BEFORE_M
        for along_m, name, index in self._path.lights:
            ahead_m = along_m - self._front_m()
            if 0 <= ahead_m < SIGHT_M:
                state = light(name, index)
                needed_mps2 = self._speed_mps**2 / (2 * max(ahead_m, 0.1))
                if state in "rRuU" or (state in "yY" and needed_mps2 < YELLOW_MPS2):
                    distance_m = min(distance_m, ahead_m - STOP_BEFORE_M)
        return max(float(distance_m) + self._idm.standstill_m, 0.1)


def _speed_profile(path: LanePath, desired_mps: float, braking_mps2: float) -> Float64:
    """Desired speeds (K,) along the path: within the limits, slow in curves, and braking early for both."""
    reach = 3  # metres to both sides over which the direction is taken
    before, after = np.roll(path.places_m, reach, axis=0), np.roll(path.places_m, -reach, axis=0)
    incoming, outgoing = path.places_m - before, after - path.places_m
    turned = wrap_angle(
        np.arctan2(outgoing[:, 1], outgoing[:, 0]) - np.arctan2(incoming[:, 1], incoming[:, 0])
    )
    turned[:reach] = turned[-reach:] = 0.0
    curvature = np.abs(turned) / reach
    speeds: Float64 = np.minimum(path.limits_mps, desired_mps)
    speeds = np.minimum(speeds, np.sqrt(CURVE_MPS2 / np.maximum(curvature, 1e-6)))
    steps_m = np.diff(path.along_m)
    for index in range(len(speeds) - 2, -1, -1):
        speeds[index] = min(
            speeds[index], np.sqrt(speeds[index + 1] ** 2 + 2 * braking_mps2 * steps_m[index])
        )
    return speeds
