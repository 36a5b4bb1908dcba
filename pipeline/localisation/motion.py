"""A vehicle's true motion between its poses, as its inertial sensors measure it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.rotations import rotation, rotation_vector

GRAVITY_MPS2 = np.array([0.0, 0.0, -9.80665])
"""In the map's frame: standard gravity (ISO 80000-3), straight down."""


@dataclass(frozen=True)
class MotionStep:
    """The motion in one step that ended at `map_SE3_base`.

    velocity_mps: (3,) in the map's frame, at its end. turn_rate_radps: (3,) in base_link, all along.
    specific_force_mps2: (n, 3) in base_link, the mean of each of n equal parts of the step; at rest it is
    +9.80665 m/s² upwards. The first step has no past and n = 0.
    """

    map_SE3_base: Float64
    velocity_mps: Float64
    turn_rate_radps: Float64
    specific_force_mps2: Float64

    @property
    def base_velocity_mps(self) -> Float64:
        """The velocity (3,) in base_link."""
        velocity: Float64 = self.map_SE3_base[:3, :3].T @ self.velocity_mps
        return velocity


class Motion:
    """The motion through a sequence of poses, one per step; it passes through each of them.

    The turn rate is constant in a step. The velocity at a pose is 1.5 times the mean velocity of the step
    before it minus half of that of the one before that: exact for a constant acceleration, without a look
    ahead, and without the ringing of a velocity carried on from step to step. In between it follows the
    parabola that makes the position right: v(u) = v0 + (v1 - v0) u + c u (1 - u), with u from 0 to 1,
    taken at n + 1 instants and linear between them, so that the sums of an inertial navigation at the
    sensor's rate (velocity: sum of accelerations; position: trapezoids of velocity) return to the pose to
    rounding. A jump of the position is thus a short and violent acceleration, not an error.
    """

    def __init__(self, step_s: float, samples: int) -> None:
        self._step_s = step_s
        self._samples = samples
        u = np.linspace(0, 1, samples + 1)[:, None]
        self._u = u
        # sum of trapezoids of u (1 - u) is (1 - 1/n^2) / 6
        self._bulge = 6 / (1 - samples**-2) * u * (1 - u)
        self._last: MotionStep | None = None
        self._mean_mps = np.zeros(3)

    def advance(self, map_SE3_base: Float64, velocity_mps: Float64) -> MotionStep:
        """The step that ends at a pose (4, 4); `velocity_mps` (3,) in the map's frame starts the first."""
        if self._last is None:
            self._mean_mps = np.array(velocity_mps, dtype=np.float64)
            step = MotionStep(map_SE3_base, self._mean_mps, np.zeros(3), np.zeros((0, 3)))
        else:
            step = self._step(self._last, map_SE3_base)
        self._last = step
        return step

    def _step(self, last: MotionStep, map_SE3_base: Float64) -> MotionStep:
        from_rotation = last.map_SE3_base[:3, :3]
        rate_radps = rotation_vector(from_rotation.T @ map_SE3_base[:3, :3]) / self._step_s
        mean_mps = (map_SE3_base[:3, 3] - last.map_SE3_base[:3, 3]) / self._step_s
        start_mps, end_mps = last.velocity_mps, 1.5 * mean_mps - 0.5 * self._mean_mps
        self._mean_mps = mean_mps
        bulge_mps = mean_mps - (start_mps + end_mps) / 2
        velocities = start_mps + self._u * (end_mps - start_mps) + self._bulge * bulge_mps
        acceleration = np.diff(velocities, axis=0) / (self._step_s / self._samples)
        middles_s = self._step_s * (self._u[:-1] + self._u[1:]) / 2
        rotations = from_rotation @ rotation(rate_radps * middles_s)
        force = np.einsum("nji,nj->ni", rotations, acceleration - GRAVITY_MPS2)
        return MotionStep(map_SE3_base, end_mps, rate_radps, force)
