"""How ghost vehicles move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle, yaw_of
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep


class GhostMotion(NamedTuple):
    """The motion of a ghost vehicle at the start of a step; its pose (4, 4) is on the ground, at the middle.

    speed_mps: negative when reversing. acceleration_mps2: forward. yaw_rate_radps: positive to the left.
    """

    map_SE3_base: Float64
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_radps: float


class OffsetMotion:
    """The motion of a place at a constant offset in a vehicle's frame, which turns with it."""

    def __init__(self, offset_m: tuple[float, float]) -> None:
        self._offset_m = np.array([*offset_m, 0.0])
        self._before: tuple[int, float, float] | None = None

    def motion(self, step: V2xStep, radio: RadioPlace) -> GhostMotion:
        """The motion in this step; call it in each step in which the vehicle is on the road."""
        pose = radio.map_SE3_base.copy()
        pose[:3, 3] = transform_points(radio.map_SE3_base, self._offset_m)
        yaw_rad, yaw_rate_radps, acceleration_mps2 = yaw_of(pose), 0.0, 0.0
        elapsed_s = 0.0
        if self._before is not None:
            elapsed_s = (step.begin_ns - self._before[0]) / 1e9
            yaw_rate_radps = float(wrap_angle(yaw_rad - self._before[1])) / elapsed_s
        # Velocity of a point of a turning body: only the leftward part of the offset changes its speed along
        # the heading.
        forward_mps = float(radio.map_SE3_base[:3, 0] @ radio.velocity_mps)
        speed_mps = forward_mps - yaw_rate_radps * float(self._offset_m[1])
        if self._before is not None:
            acceleration_mps2 = (speed_mps - self._before[2]) / elapsed_s
        self._before = step.begin_ns, yaw_rad, speed_mps
        return GhostMotion(pose, speed_mps, acceleration_mps2, yaw_rate_radps)


class BrakingMotion(NamedTuple):
    """Straight motion from a pose: constant speed for a while, then constant braking to a final speed."""

    map_SE3_start: Float64
    begin_ns: int
    speed_mps: float
    cruise_s: float
    deceleration_mps2: float
    final_mps: float

    def motion(self, time_ns: int) -> GhostMotion:
        """The motion at a time; before the start, with the same speed."""
        elapsed_s = (time_ns - self.begin_ns) / 1e9
        is_braking = 0 <= elapsed_s - self.cruise_s < self._stop_s
        braking_s = min(max(elapsed_s - self.cruise_s, 0.0), self._stop_s)
        after_s = max(elapsed_s - self.cruise_s - self._stop_s, 0.0)
        distance_m = self.speed_mps * (min(elapsed_s, self.cruise_s) + braking_s)
        distance_m += self.final_mps * after_s - self.deceleration_mps2 * braking_s**2 / 2
        pose = self.map_SE3_start.copy()
        pose[:3, 3] += distance_m * pose[:3, 0]
        speed_mps = self.speed_mps - self.deceleration_mps2 * braking_s
        speed_mps = max(speed_mps, min(self.final_mps, self.speed_mps))  # no rounding below standstill
        return GhostMotion(pose, speed_mps, -self.deceleration_mps2 if is_braking else 0.0, 0.0)

    @property
    def _stop_s(self) -> float:
        return max(self.speed_mps - self.final_mps, 0.0) / self.deceleration_mps2
