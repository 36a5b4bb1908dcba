"""A Kalman filter of one station: does the next claim match the prediction from the previous ones?"""

from __future__ import annotations

import math
from typing import NamedTuple

LONGEST_STEP_S = 0.5
"""Drivers hold an acceleration for about so long; where messages are missing, several steps pass."""


class _Axis(NamedTuple):
    """Position and velocity along one axis, and their covariance."""

    place: float
    velocity: float
    p_pp: float
    p_pv: float
    p_vv: float


class Kalman:
    """Constant velocity with white acceleration noise, x and y independent; measures positions and
    velocities.

    Four degrees of freedom; in closed form, as there are thousands of messages. `innovation` evaluates a
    claim, `accept` updates the filter with the claim evaluated last.
    """

    def __init__(self, acceleration_mps2: float, position_m: float, speed_mps: float) -> None:
        self._q = acceleration_mps2**2
        self._r = position_m**2, speed_mps**2
        self._axes: tuple[_Axis, _Axis] | None = None
        self._next: tuple[_Axis, _Axis] | None = None

    def innovation(
        self,
        elapsed_s: float,
        place_m: tuple[float, float],
        velocity_mps: tuple[float, float],
        turning_mps2: float = 0.0,
        swing_m: float = 0.0,
    ) -> float:
        """The normalised innovation squared of a claim `elapsed_s` after the one accepted last.

        turning_mps2: the centripetal acceleration, swing_m: the motion of the box's centre across its
        heading; the filter models neither. 0 for the first claim.
        """
        if self._axes is None:
            r_p, r_v = self._r
            x, y = (_Axis(p, v, r_p, 0.0, r_v) for p, v in zip(place_m, velocity_mps, strict=True))
            self._next = x, y
            return 0.0
        q = self._q + turning_mps2**2
        (x, nis_x), (y, nis_y) = (
            self._step(_predicted(axis, elapsed_s, q), p, v, swing_m**2)
            for axis, p, v in zip(self._axes, place_m, velocity_mps, strict=True)
        )
        self._next = x, y
        return nis_x + nis_y

    def accept(self) -> None:
        """Update the filter with the claim evaluated last."""
        self._axes = self._next

    def _step(self, axis: _Axis, place: float, velocity: float, swing: float) -> tuple[_Axis, float]:
        """The axis after a measurement, and the innovation; swing: variance of the place beyond its own."""
        (r_p, r_v), (_, _, p_pp, p_pv, p_vv) = self._r, axis
        r_p += swing
        y_p, y_v = place - axis.place, velocity - axis.velocity
        s_pp, s_vv = p_pp + r_p, p_vv + r_v
        det = s_pp * s_vv - p_pv * p_pv
        nis = (s_vv * y_p * y_p - 2 * p_pv * y_p * y_v + s_pp * y_v * y_v) / det
        # K = P S^-1, row by row.
        k_pp, k_pv = (p_pp * s_vv - p_pv * p_pv) / det, (p_pv * s_pp - p_pp * p_pv) / det
        k_vp, k_vv = (p_pv * s_vv - p_vv * p_pv) / det, (p_vv * s_pp - p_pv * p_pv) / det
        return (
            _Axis(
                axis.place + k_pp * y_p + k_pv * y_v,
                axis.velocity + k_vp * y_p + k_vv * y_v,
                p_pp - k_pp * p_pp - k_pv * p_pv,
                p_pv - k_pp * p_pv - k_pv * p_vv,
                p_vv - k_vp * p_pv - k_vv * p_vv,
            ),
            nis,
        )


def _predicted(axis: _Axis, elapsed_s: float, q: float) -> _Axis:
    """The axis some time later; the acceleration is constant over a step and drawn anew for each."""
    steps = max(math.ceil(elapsed_s / LONGEST_STEP_S), 1)
    t = elapsed_s / steps
    for _ in range(steps):
        axis = _Axis(
            axis.place + t * axis.velocity,
            axis.velocity,
            axis.p_pp + 2 * t * axis.p_pv + t * t * axis.p_vv + q * t**4 / 4,
            axis.p_pv + t * axis.p_vv + q * t**3 / 2,
            axis.p_vv + q * t * t,
        )
    return axis
