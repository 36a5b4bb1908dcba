"""Wheel odometry: speed and turn rate from the wheels, and dead reckoning from both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.localisation.measurements import WheelTwist
from advpipe.pipeline.localisation.section import WheelOdometrySensor

NOT_MEASURED = 1e6
"""The variance of components that wheels do not measure, by ROS convention."""


class WheelOdometer:
    """Speed and turn rate from the wheels of one axle.

    The systematic errors of Borenstein and Feng (1996, "Measurement and correction of systematic odometry
    errors in mobile robots"), drawn once for the vehicle: tyres of another mean radius scale the speed, a
    wrong effective track width (their E_b) scales the turn rate, and unequal tyres (their E_d) add a turn
    for each metre driven. White noise comes on top.
    """

    def __init__(self, sensor: WheelOdometrySensor, rng: np.random.Generator) -> None:
        self._rng = rng
        self._white = np.array([sensor.speed_white_stddev_mps, sensor.turn_rate_white_stddev_radps])
        errors = np.array(
            [sensor.speed_scale_stddev, sensor.turn_rate_scale_stddev, sensor.curvature_stddev_1pm]
        ) * rng.standard_normal(3)
        self._speed_scale, self._turn_scale, self._curvature_1pm = (float(error) for error in errors)

    def measure(self, speed_mps: float, turn_rate_radps: float) -> WheelTwist:
        """The measured twist of a true one."""
        noise = self._white * self._rng.standard_normal(2)
        speed = (1 + self._speed_scale) * speed_mps
        turn = (1 + self._turn_scale) * turn_rate_radps + self._curvature_1pm * speed_mps
        return WheelTwist(float(speed + noise[0]), float(turn + noise[1]))


@dataclass(frozen=True)
class WheelEstimate:
    """The pose estimated from the wheels alone.

    odom_SE3_base: the pose in the frame `odom`, in which the vehicle started. pose_covariance: (6, 6)
    along the axes of `odom`. twist_covariance: (6, 6) along those of base_link.
    """

    odom_SE3_base: Float64
    pose_covariance: Float64
    twist_covariance: Float64


class DeadReckoning:
    """The pose that measured wheel twists add up to, with its covariance.

    Each step is an arc of the mean of its two twists. The covariance follows to first order (Siegwart and
    Nourbakhsh, "Introduction to autonomous mobile robots", section 5.2.4), with the systematic errors as
    constant states: x, y, yaw, speed scale, turn scale, curvature. First order ends where the yaw is some
    0.1 rad uncertain, with the defaults after about 150 m.
    """

    def __init__(self, sensor: WheelOdometrySensor, step_s: float) -> None:
        self._step_s = step_s
        self._pose = np.zeros(3)
        self._last: WheelTwist | None = None
        systematic = [sensor.speed_scale_stddev, sensor.turn_rate_scale_stddev, sensor.curvature_stddev_1pm]
        self._covariance = np.diag(np.square([0.0, 0.0, 0.0, *systematic]))
        self._white = np.diag(np.square([sensor.speed_white_stddev_mps, sensor.turn_rate_white_stddev_radps]))

    def advance(self, twist: WheelTwist) -> WheelEstimate:
        """Advance by the next twist; the first starts at the origin."""
        if self._last is not None:
            self._arc(self._last, twist)
        self._last = twist
        x_m, y_m, yaw_rad = self._pose
        pose = NOT_MEASURED * np.eye(6)
        planar = [0, 1, 5]
        pose[np.ix_(planar, planar)] = self._covariance[:3, :3]
        return WheelEstimate(se3_from_yaw([x_m, y_m, 0.0], yaw_rad), pose, self._twist_covariance(twist))

    def _arc(self, last: WheelTwist, twist: WheelTwist) -> None:
        distance_m = self._step_s * (last.speed_mps + twist.speed_mps) / 2
        turn_rad = self._step_s * (last.turn_rate_radps + twist.turn_rate_radps) / 2
        middle_rad = self._pose[2] + turn_rad / 2
        along = np.array([np.cos(middle_rad), np.sin(middle_rad)])
        across = distance_m * np.array([-along[1], along[0]])
        self._pose = self._pose + [*(distance_m * along), turn_rad]
        inputs = np.zeros((6, 2))  # from an error of the distance, and of the turn
        inputs[:2, 0], inputs[:2, 1], inputs[2, 1] = along, across / 2, 1.0
        transition = np.eye(6)
        transition[:2, 2] = across
        # The true twist is the measured one less these, so that their signs do not matter here.
        transition[:, 3] += distance_m * inputs[:, 0]
        transition[:, 4] += turn_rad * inputs[:, 1]
        transition[:, 5] += distance_m * inputs[:, 1]
        noise = inputs @ self._white @ inputs.T * self._step_s**2
        self._covariance = transition @ self._covariance @ transition.T + noise

    def _twist_covariance(self, twist: WheelTwist) -> Float64:
        errors = np.array([[twist.speed_mps, 0, 0], [0, twist.turn_rate_radps, twist.speed_mps]])
        covariance = NOT_MEASURED * np.eye(6)
        measured = [0, 5]
        systematic = errors @ self._covariance[3:, 3:] @ errors.T
        covariance[np.ix_(measured, measured)] = systematic + self._white
        return covariance
