"""The sensor measurements of a vehicle in one step: the only input of its filter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, se3_from_quaternion


@dataclass(frozen=True)
class ImuSamples:
    """n samples in the frame base_link.

    stamps_ns: (n,), ascending; each sample is the mean over the time from the stamp before it to its own.
    specific_force_mps2, angular_rate_radps: (n, 3).
    """

    stamps_ns: npt.NDArray[np.int64]
    specific_force_mps2: Float64
    angular_rate_radps: Float64


@dataclass(frozen=True)
class WheelTwist:
    """Speed along the x axis and turn rate about the z axis of base_link."""

    speed_mps: float
    turn_rate_radps: float


@dataclass(frozen=True)
class SensedMotion:
    """What error-free sensors of a world of its own measured at one instant; None without such a sensor.

    position_m: (3,) of base_link in the map. specific_force_mps2, turn_rate_radps: (3,) in base_link, in the
    step that ends at the instant.
    """

    position_m: Float64 | None = None
    specific_force_mps2: Float64 | None = None
    turn_rate_radps: Float64 | None = None


@dataclass(frozen=True)
class Measurements:
    """Everything measured in one step, up to its stamp.

    imu: the samples since the step before. fix: latitude and longitude in degrees and altitude in metres
    (3,), None without one: between two fixes, or where the receiver is jammed.
    """

    stamp_ns: int
    imu: ImuSamples
    wheel: WheelTwist | None
    fix: Float64 | None


@dataclass(frozen=True)
class InitialPose:
    """The initial pose of a filter, as known from a driver or the end of the last drive.

    position_m: (3,) in the map. xyzw: orientation (4,). covariance: (6, 6) of x, y, z and the rotations
    about the map's axes.
    """

    position_m: Float64
    xyzw: Float64
    covariance: Float64

    @property
    def map_SE3_base(self) -> Float64:
        """The pose (4, 4)."""
        return se3_from_quaternion(self.xyzw, self.position_m)
