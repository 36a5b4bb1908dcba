"""The output of the on-board filter."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.geometry.transforms import Float64


@dataclass(frozen=True)
class Innovation:
    """The innovation of a fix: its distance from the filter's prediction.

    residual_m: (3,) in the map. covariance_m2: (3, 3), expected by the filter. nis: the normalised
    innovation squared, residual' covariance^-1 residual: chi-square with 3 degrees of freedom where fixes
    are as modelled. accepted: False where the gate dropped the fix.
    """

    residual_m: Float64
    covariance_m2: Float64
    nis: float
    accepted: bool


@dataclass(frozen=True)
class Estimate:
    """The filter's state estimate at a stamp.

    base_velocity_mps, base_turn_rate_radps: (3,) in base_link. pose_covariance: (6, 6) of x, y, z and of
    small rotations about x, y, z, all along the axes of the map (the header's frame in nav_msgs/Odometry).
    twist_covariance: (6, 6) of velocity and turn rate along the axes of base_link (the child's frame).
    innovation: None without a fix.
    """

    stamp_ns: int
    map_SE3_base: Float64
    base_velocity_mps: Float64
    base_turn_rate_radps: Float64
    pose_covariance: Float64
    twist_covariance: Float64
    innovation: Innovation | None
