"""The on-board filter: an error-state Kalman filter over IMU, wheels and satellite fixes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.localisation.estimate import Estimate, Innovation
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.gnss import HEIGHT_FACTOR
from advpipe.pipeline.localisation.measurements import ImuSamples, InitialPose, Measurements, WheelTwist
from advpipe.pipeline.localisation.motion import GRAVITY_MPS2
from advpipe.pipeline.localisation.rotations import rotation, skew
from advpipe.pipeline.localisation.section import OnBoardSensors
from advpipe.pipeline.localisation.strapdown import Increment, integrate

STATES = 19
POSITION, VELOCITY, ORIENTATION = slice(0, 3), slice(3, 6), slice(6, 9)
FORCE_BIAS, RATE_BIAS, DRIFT, SCALE = slice(9, 12), slice(12, 15), slice(15, 18), 18
UNKNOWN_SPEED_MPS = 15.0
"""Standard deviation of the initial speed of a filter without wheel odometry."""
START_SLIDE_MPS = 0.5
"""Standard deviation of the initial sideways and upward speed, while the turn rate is unknown."""

LEAST_STDDEV_M, LEAST_STDDEV_MPS = 0.005, 0.005
"""Minimum noise of a fix and a wheel speed: with none, the filter's covariance is lost to rounding."""

FARTHEST_M = 1e7
"""Largest distance from the map's origin; an estimate beyond it has diverged."""

UNSEEN = np.array([4.0, 4.0, 1.0, 0.2, 0.2, 0.5])
"""Standard deviation of a vehicle's acceleration, m/s², and turn rate, rad/s, during missing IMU samples."""


class Estimator:
    """Position, velocity, orientation, IMU biases, the wandering offset of fixes, and the wheels' scale.

    Solà 2017, "Quaternion kinematics for the error-state Kalman filter", with angular errors in the map's
    frame (section 7). The nominal state follows every IMU sample; the covariance is propagated once in a
    step, with derivatives summed over its samples. Corrections as in section 6, in Joseph's form. The
    offset of fixes is a state, as it would otherwise pass for knowledge. Wheels, and the fact that
    vehicles hardly slide, give the velocity in base_link.

    It uses measurements only, and the same ones give the same bits. sensors: the assumed sensor models.
    geodesy: the map's place on the Earth. initial: where it starts.
    """

    def __init__(self, sensors: OnBoardSensors, geodesy: Geodesy, initial: InitialPose) -> None:
        self._sensors = sensors
        self._geodesy = geodesy
        self._initial = initial
        axes = np.array([1.0, 1.0, HEIGHT_FACTOR])
        self._fix_m2 = np.diag(np.square(max(sensors.gnss.white_stddev_m, LEAST_STDDEV_M) * axes))
        self._wheel_mps = max(sensors.wheel_odometry.speed_white_stddev_mps, LEAST_STDDEV_MPS)
        imu = sensors.imu
        stddev = np.zeros(STATES)  # of the states that wander about zero
        stddev[FORCE_BIAS] = imu.accelerometer_bias_stddev_mps2
        stddev[RATE_BIAS] = imu.gyroscope_bias_stddev_radps
        stddev[DRIFT] = sensors.gnss.drift_stddev_m * axes
        stddev[SCALE] = sensors.wheel_odometry.speed_scale_stddev
        self._stationary = np.square(stddev)
        self._forgetting_1ps = np.zeros(STATES)
        self._forgetting_1ps[9:15] = 1 / imu.bias_time_s
        self._forgetting_1ps[DRIFT] = 1 / sensors.gnss.drift_time_s
        self._gate = np.inf
        if sensors.localisation.gate_probability is not None:
            from scipy.special import chdtri

            self._gate = float(chdtri(3, 1 - sensors.localisation.gate_probability))
        self._stamp_ns: int | None = None
        self._position = np.zeros(3)
        self._velocity = np.zeros(3)
        self._rotation = np.eye(3)
        self._wandering = np.zeros(STATES)  # the last ten; the first nine are the three above
        self._rate = np.zeros(3)
        self._covariance = np.diag(self._stationary)

    def step(self, measured: Measurements) -> Estimate:
        """The estimate at the measurements' stamp; the first step needs no IMU samples.

        Raises AdvpipeError for stamps that do not ascend, for measurements that are not finite, and once the
        estimate is beyond `FARTHEST_M`.
        """
        if self._stamp_ns is None:
            self._start(measured.wheel)
        else:
            duration_s = self._propagate(self._stamp_ns, measured)
            self._correct_velocity(measured.wheel, duration_s)
        self._stamp_ns = measured.stamp_ns
        innovation = None if measured.fix is None else self._correct_position(measured.fix)
        if not np.abs(self._position).max() <= FARTHEST_M:  # nor NaN
            raise AdvpipeError(f"at {measured.stamp_ns} ns the estimate has diverged, far off the map")
        return self._estimate(measured.stamp_ns, innovation)

    def _start(self, wheel: WheelTwist | None) -> None:
        """Start from the initial pose and the wheels' speed straight ahead."""
        start = self._initial.map_SE3_base
        self._position, self._rotation = start[:3, 3].copy(), start[:3, :3].copy()
        speed_mps, speed_stddev = 0.0, UNKNOWN_SPEED_MPS
        if wheel is not None:
            speed_mps, speed_stddev = wheel.speed_mps, self._wheel_mps
            self._rate = np.array([0.0, 0.0, wheel.turn_rate_radps])
        self._velocity = self._rotation[:, 0] * speed_mps
        # Sources of error: the pose, the drifting states, and in VELOCITY the velocity in base_link.
        sources = np.diag(self._stationary)
        pose = np.r_[0:3, 6:9]
        sources[np.ix_(pose, pose)] = self._initial.covariance
        sources[VELOCITY, VELOCITY] = np.diag(np.square([speed_stddev, START_SLIDE_MPS, START_SLIDE_MPS]))
        spread = np.eye(STATES)
        spread[VELOCITY, VELOCITY] = self._rotation
        spread[VELOCITY, ORIENTATION] = -skew(self._velocity)
        spread[VELOCITY, SCALE] = -self._velocity
        self._covariance = spread @ sources @ spread.T

    def _propagate(self, last_ns: int, measured: Measurements) -> float:
        durations_s, force, rate, unseen = self._samples(last_ns, measured.stamp_ns, measured.imu)
        self._rate = rate[-1] - self._wandering[RATE_BIAS]
        moved = integrate(
            self._rotation,
            durations_s,
            force - self._wandering[FORCE_BIAS],
            rate - self._wandering[RATE_BIAS],
        )
        duration_s = moved.duration_s
        memory = np.exp(-duration_s * self._forgetting_1ps)
        transition = np.diag(memory)
        transition[POSITION, VELOCITY] = np.eye(3) * duration_s
        transition[VELOCITY, ORIENTATION] = -skew(moved.felt_velocity_mps)
        transition[POSITION, ORIENTATION] = -skew(moved.felt_position_m)
        transition[VELOCITY, FORCE_BIAS] = -moved.turned_s
        transition[POSITION, FORCE_BIAS] = -moved.pushed_s2
        transition[ORIENTATION, RATE_BIAS] = -moved.turned_s
        transition[VELOCITY, RATE_BIAS] = -moved.velocity_per_rate
        transition[POSITION, RATE_BIAS] = -moved.position_per_rate
        covariance = transition @ self._covariance @ transition.T
        covariance.flat[:: STATES + 1] += (1 - memory**2) * self._stationary
        self._add_noise(covariance, moved, unseen)
        self._covariance = (covariance + covariance.T) / 2
        self._position = self._position + self._velocity * duration_s + moved.position_m
        self._velocity = self._velocity + moved.velocity_mps
        self._rotation = _orthonormal(moved.rotation)
        self._wandering = memory * self._wandering
        return duration_s

    def _add_noise(self, covariance: Float64, moved: Increment, unseen: Float64) -> None:
        """Add the IMU's white noise over a step, and the unmeasured velocity and angle (6,)."""
        imu, duration_s = self._sensors.imu, moved.duration_s
        force = imu.accelerometer_noise_density**2 * np.eye(3) * duration_s
        rate = imu.gyroscope_noise_density**2 * np.eye(3) * duration_s
        lever_s, square_s2 = duration_s / 2, duration_s**2 / 3
        if unseen.any():
            mean = moved.turned_s / duration_s
            force = force + mean @ np.diag(np.square(unseen[:3])) @ mean.T
            rate = rate + mean @ np.diag(np.square(unseen[3:])) @ mean.T
        covariance[VELOCITY, VELOCITY] += force
        covariance[POSITION, VELOCITY] += force * lever_s
        covariance[VELOCITY, POSITION] += force * lever_s
        covariance[POSITION, POSITION] += force * square_s2
        covariance[ORIENTATION, ORIENTATION] += rate

    def _samples(
        self, last_ns: int, stamp_ns: int, imu: ImuSamples
    ) -> tuple[Float64, Float64, Float64, Float64]:
        """Durations (n,), specific force (n, 3), rate (n, 3), and the unmeasured part (6,) of the step.

        A sample covers the time since the previous one. A saturated axis may miss as much
        again as it can measure. Where samples are missing at the end, only gravity is assumed.
        """
        stamps: npt.NDArray[np.int64] = np.concatenate([[last_ns], imu.stamps_ns]).astype(np.int64)
        force, rate = imu.specific_force_mps2, imu.angular_rate_radps
        gap = stamps[-1] < stamp_ns
        if gap:
            stamps = np.append(stamps, stamp_ns)
            force = np.vstack([force, -self._rotation.T @ GRAVITY_MPS2 + self._wandering[FORCE_BIAS]])
            rate = np.vstack([rate, self._wandering[RATE_BIAS]])
        durations_s = np.diff(stamps) / 1e9
        if stamps[-1] > stamp_ns or durations_s.min() <= 0:
            raise AdvpipeError(
                f"IMU samples up to {stamp_ns} ns do not ascend from {last_ns} ns to it; check their stamps"
            )
        if not (np.isfinite(force).all() and np.isfinite(rate).all()):
            raise AdvpipeError(f"an IMU sample up to {stamp_ns} ns is not finite")
        limit = self._sensors.imu
        full_scale = np.repeat([limit.accelerometer_range_mps2, limit.gyroscope_range_radps], 3)
        missed = full_scale * (np.abs(np.hstack([force, rate])) >= full_scale)
        if gap:
            missed[-1] = UNSEEN
        return durations_s, force, rate, durations_s @ missed

    def _slip_m2ps2(self) -> Float64:
        """Variance of the sideways and upward speed (2,): a constant plus a lever times the turn rate.

        Measured on SUMO's cars, whose box slides with a turn: 0.03 to 0.1 m/s while straight, and beyond
        that 0.8 to 1.9 m times the turn rate.
        """
        assumed = self._sensors.localisation
        turn_radps = np.array([self._rate[2], self._rate[1]])
        variance: Float64 = assumed.slip_stddev_mps**2 + np.square(assumed.slip_lever_m * turn_radps)
        return variance

    def _correct_velocity(self, wheel: WheelTwist | None, duration_s: float) -> None:
        """Correct by the wheels' speed along x, and by speeds about zero along y and z of base_link."""
        base_velocity = self._rotation.T @ self._velocity
        jacobian = np.zeros((3, STATES))
        jacobian[:, VELOCITY] = self._rotation.T
        jacobian[:, ORIENTATION] = self._rotation.T @ skew(self._velocity)
        residual = -base_velocity
        # Slip is correlated over time; white noise of the same low-frequency density represents it.
        lasting = max(1.0, 2 * self._sensors.localisation.slip_time_s / duration_s)
        noise = np.diag([0.0, *(lasting * self._slip_m2ps2())])
        if wheel is None:
            self._update(jacobian[1:], residual[1:], noise[1:, 1:])
            return
        if not np.isfinite(wheel.speed_mps):
            raise AdvpipeError(f"wheel speed {wheel.speed_mps} m/s is not finite")
        scale = 1 + self._wandering[SCALE]
        jacobian[0] *= scale
        jacobian[0, SCALE] = base_velocity[0]
        residual[0] = wheel.speed_mps - scale * base_velocity[0]
        noise[0, 0] = self._wheel_mps**2
        self._update(jacobian, residual, noise)

    def _correct_position(self, fix: Float64) -> Innovation:
        """Correct by a fix, which is the position plus the drifting offset plus white noise."""
        if not np.isfinite(fix).all():
            raise AdvpipeError(f"fix {fix.tolist()} is not finite")
        residual = self._geodesy.to_map(fix) - self._position - self._wandering[DRIFT]
        jacobian = np.zeros((3, STATES))
        jacobian[:, POSITION] = jacobian[:, DRIFT] = np.eye(3)
        expected = jacobian @ self._covariance @ jacobian.T + self._fix_m2
        nis = float(residual @ np.linalg.solve(expected, residual))
        accepted = nis <= self._gate
        if accepted:
            self._update(jacobian, residual, self._fix_m2)
        return Innovation(residual, expected, nis, accepted)

    def _update(self, jacobian: Float64, residual: Float64, noise: Float64) -> None:
        """Kalman's correction in Joseph's form, moved into the nominal state (Solà 6.1 and 6.2)."""
        cross = self._covariance @ jacobian.T
        gain = np.linalg.solve(jacobian @ cross + noise, cross.T).T
        error = gain @ residual
        keep = np.eye(STATES) - gain @ jacobian
        self._covariance = keep @ self._covariance @ keep.T + gain @ noise @ gain.T
        self._position = self._position + error[POSITION]
        self._velocity = self._velocity + error[VELOCITY]
        self._rotation = _orthonormal(rotation(error[ORIENTATION]) @ self._rotation)
        self._wandering[9:] += error[9:]

    def _estimate(self, stamp_ns: int, innovation: Innovation | None) -> Estimate:
        pose = np.r_[0:3, 6:9]
        to_base = np.zeros((3, STATES))
        to_base[:, VELOCITY] = self._rotation.T
        to_base[:, ORIENTATION] = self._rotation.T @ skew(self._velocity)
        twist = np.zeros((6, 6))
        twist[:3, :3] = to_base @ self._covariance @ to_base.T
        imu = self._sensors.imu
        sample_noise = imu.rate_hz * imu.gyroscope_noise_density**2
        twist[3:, 3:] = self._covariance[RATE_BIAS, RATE_BIAS] + sample_noise * np.eye(3)
        return Estimate(
            stamp_ns,
            se3(self._rotation, self._position),
            self._rotation.T @ self._velocity,
            self._rate.copy(),
            self._covariance[np.ix_(pose, pose)],
            twist,
            innovation,
        )


def _orthonormal(matrix: Float64) -> Float64:
    """The nearest rotation to a matrix with rounding errors: one step of Newton's iteration."""
    nearest: Float64 = matrix @ (1.5 * np.eye(3) - 0.5 * matrix.T @ matrix)
    return nearest
