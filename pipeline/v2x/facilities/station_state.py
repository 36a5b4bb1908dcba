"""A station's own state when it generates a CAM: its on-board estimate, or truth plus noise."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.codes import (
    AccelerationControl,
    CurvatureCalculationMode,
    DriveDirection,
    ExteriorLights,
    TrailerPresence,
    VehicleRole,
)


@dataclass(frozen=True, kw_only=True, slots=True)
class StationState:
    """A vehicle's state at one time; standard deviations (`_std_`) are 1 sigma, None where unknown.

    time_ns: UTC since 1970, the time that the position is valid at.
    latitude_deg, longitude_deg, altitude_m: WGS 84, of ETSI's reference point: on the ground below the
    middle of the front side of the vehicle's box (EN 302 637-2, B.19).
    east_north_covariance_m2: (east-east, east-north, north-north) of that position.
    heading_rad: clockwise from true north. speed_mps: the magnitude; `drive_direction` has the sign.
    Accelerations: forward, to the left, upward. yaw_rate_radps and curvature_per_m: positive to the left.
    """

    station_id: int
    station_type: int
    time_ns: int
    latitude_deg: float
    longitude_deg: float
    heading_rad: float
    speed_mps: float
    length_m: float
    width_m: float
    altitude_m: float | None = None
    longitudinal_acceleration_mps2: float | None = None
    lateral_acceleration_mps2: float | None = None
    vertical_acceleration_mps2: float | None = None
    yaw_rate_radps: float | None = None
    curvature_per_m: float | None = None
    steering_wheel_rad: float | None = None
    lane_position: int | None = None
    east_north_covariance_m2: tuple[float, float, float] | None = None
    altitude_std_m: float | None = None
    heading_std_rad: float | None = None
    speed_std_mps: float | None = None
    acceleration_std_mps2: float | None = None
    yaw_rate_std_radps: float | None = None
    curvature_std_per_m: float | None = None
    drive_direction: DriveDirection = DriveDirection.FORWARD
    curvature_mode: CurvatureCalculationMode = CurvatureCalculationMode.YAW_RATE_USED
    trailer: TrailerPresence = TrailerPresence.NONE
    acceleration_control: AccelerationControl | None = None
    vehicle_role: VehicleRole = VehicleRole.DEFAULT
    exterior_lights: ExteriorLights = ExteriorLights.DAYTIME_RUNNING
