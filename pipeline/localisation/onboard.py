"""On-board localisation of one vehicle: its sensors measure its true motion, its filter uses them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64, quaternion_xyzw, se3
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.gnss import GnssReceiver
from advpipe.pipeline.localisation.imu import ImuModel
from advpipe.pipeline.localisation.measurements import (
    ImuSamples,
    InitialPose,
    Measurements,
    SensedMotion,
)
from advpipe.pipeline.localisation.motion import Motion, MotionStep
from advpipe.pipeline.localisation.rotations import rotation
from advpipe.pipeline.localisation.section import LocalisationFilter, OnBoardSensors
from advpipe.pipeline.localisation.wheel import DeadReckoning, WheelEstimate, WheelOdometer


@dataclass(frozen=True)
class OnBoardStep:
    """One on-board step: the truth, the sensors' measurements, and the filter's estimate.

    fix_stddev_m: (3,) of a fix to the east, north and up. odometry: dead reckoning from the wheels alone.
    """

    truth: MotionStep
    measured: Measurements
    fix_stddev_m: Float64
    odometry: WheelEstimate
    estimate: Estimate


class OnBoard:
    """The GNSS receiver, IMU, wheels and filter of the vehicle `name`; call `step` once per step.

    All sensors are in base_link's origin, as if their lever arms were known and compensated. step_s: from one
    step to the next. seed: of the scenario. Raises AdvpipeError where a sensor's rate does not fit the step.
    """

    def __init__(
        self, name: str, sensors: OnBoardSensors, geodesy: Geodesy, step_s: float, seed: int
    ) -> None:
        self._name, self._seed = name, seed
        self._sensors = sensors
        self._geodesy = geodesy
        try:
            self._steps_per_fix = sensors.gnss.steps_per_fix(step_s)
            samples = sensors.imu.samples_per_step(step_s)
        except ValueError as error:
            raise AdvpipeError(str(error)) from None
        self._sample_ends_ns = np.rint(np.arange(1 - samples, 1) * (step_s * 1e9 / samples)).astype(np.int64)
        self._motion = Motion(step_s, samples)
        self._receiver = GnssReceiver(
            sensors.gnss, step_s * self._steps_per_fix, named_generator(seed, "gnss", name)
        )
        self._imu = ImuModel(sensors.imu, step_s, named_generator(seed, "imu", name))
        self._wheels = WheelOdometer(sensors.wheel_odometry, named_generator(seed, "wheel", name))
        self._reckoning = DeadReckoning(sensors.wheel_odometry, step_s)
        self._steps = 0
        self._estimator: Estimator | None = None
        self.initial: InitialPose | None = None

    def step(
        self,
        stamp_ns: int,
        map_SE3_base: Float64,
        velocity_mps: Float64,
        sensed: SensedMotion | None = None,
    ) -> OnBoardStep:
        """The next step, with the true pose (4, 4) and velocity (3,) in the map's frame at its stamp.

        The velocity counts in the first step only; afterwards the motion follows from the poses. `initial`
        is the pose that the filter started from, set by the first step. sensed: what another simulator's
        sensors measured without errors, which replaces the motion between the poses; errors are added as to
        that.
        """
        truth = self._motion.advance(map_SE3_base, velocity_mps)
        measured = self._measure(stamp_ns, truth, sensed or SensedMotion())
        assert measured.wheel is not None
        if self._estimator is None:
            rng = named_generator(self._seed, "initial pose", self._name)
            self.initial = _initial_pose(self._sensors.localisation, map_SE3_base, rng)
            self._estimator = Estimator(self._sensors, self._geodesy, self.initial)
        self._steps += 1
        return OnBoardStep(
            truth,
            measured,
            np.sqrt(np.diag(self._receiver.covariance_m2)),
            self._reckoning.advance(measured.wheel),
            self._estimator.step(measured),
        )

    def _measure(self, stamp_ns: int, truth: MotionStep, sensed: SensedMotion) -> Measurements:
        fix = None
        if self._steps % self._steps_per_fix == 0:
            position_m = truth.map_SE3_base[:3, 3] if sensed.position_m is None else sensed.position_m
            fix = self._geodesy.to_geographic(self._receiver.fix(position_m))
        wheel = self._wheels.measure(float(truth.base_velocity_mps[0]), float(truth.turn_rate_radps[2]))
        force = truth.specific_force_mps2
        if sensed.specific_force_mps2 is not None:  # one reading a step, held
            force = np.broadcast_to(sensed.specific_force_mps2, force.shape)
        turn_rate = truth.turn_rate_radps if sensed.turn_rate_radps is None else sensed.turn_rate_radps
        rates = np.broadcast_to(turn_rate, force.shape)
        stamps_ns = stamp_ns + self._sample_ends_ns[: len(force)]
        return Measurements(stamp_ns, ImuSamples(stamps_ns, *self._imu.measure(force, rates)), wheel, fix)


def _initial_pose(
    assumed: LocalisationFilter, map_SE3_base: Float64, rng: np.random.Generator
) -> InitialPose:
    """A pose near the true one, with the error that the filter assumes."""
    tilt_rad = np.deg2rad(assumed.start_tilt_stddev_deg)
    turns_rad = [tilt_rad, tilt_rad, np.deg2rad(assumed.start_heading_stddev_deg)]
    stddev = np.array([*[assumed.start_position_stddev_m] * 3, *turns_rad])
    error = stddev * rng.standard_normal(6)
    pose = se3(rotation(error[3:]) @ map_SE3_base[:3, :3], map_SE3_base[:3, 3] + error[:3])
    return InitialPose(pose[:3, 3], quaternion_xyzw(pose), np.diag(np.square(stddev)))
