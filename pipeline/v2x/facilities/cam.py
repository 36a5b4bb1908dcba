"""A Cooperative Awareness Message (EN 302 637-2 v1.4.1) in SI units, and its values from a station's
state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from advpipe.pipeline.v2x.codec.codes import (
    AccelerationControl,
    CurvatureCalculationMode,
    DriveDirection,
    ExteriorLights,
    TrailerPresence,
    VehicleRole,
)
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.pipeline.v2x.facilities.station_state import StationState

MAX_PATH_POINTS = 23
"""The maximum in a vehicle's CAM; the ASN.1 allows 40."""

SIGMAS_95 = 1.959964
"""Half-width of a normal distribution's 95 % interval, the confidence level of the dictionary."""
ELLIPSE_SIGMAS_95 = math.sqrt(-2 * math.log(0.05))
"""Semi-axis of a 95 % ellipse in two dimensions, in sigma: 2.4477."""


class PathPoint(NamedTuple):
    """A past position, relative to the previous point in the list, which is more recent.

    The first is relative to the CAM's reference position. None: not stated.
    """

    delta_latitude_deg: float | None
    delta_longitude_deg: float | None
    delta_altitude_m: float | None
    delta_time_s: float | None
    """How much earlier than the previous point in the list."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LowFrequency:
    """The container that a vehicle sends at most every half second."""

    vehicle_role: VehicleRole = VehicleRole.DEFAULT
    exterior_lights: ExteriorLights = ExteriorLights.NONE
    path_history: tuple[PathPoint, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Cam:
    """A CAM: None where a field is unavailable or left out, infinity where it is out of range.

    Units, frames and signs are those of `StationState`. Confidences (`_confidence_`, `semi_..._m`) are given
    at 95 %; the semi-major axis points `semi_major_rad` clockwise from north.
    roadside, special_vehicle, toll_zone: ASN.1 values that are kept unchanged; a CAM with
    `roadside` comes from a road-side unit and has no values of a vehicle's `BasicVehicleContainer`.
    """

    station_id: int
    station_type: int
    generation_delta_time_ms: int
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    semi_major_m: float | None = None
    semi_minor_m: float | None = None
    semi_major_rad: float | None = None
    altitude_m: float | None = None
    altitude_confidence_m: float | None = None
    heading_rad: float | None = None
    heading_confidence_rad: float | None = None
    speed_mps: float | None = None
    speed_confidence_mps: float | None = None
    drive_direction: DriveDirection = DriveDirection.UNAVAILABLE
    length_m: float | None = None
    trailer: TrailerPresence = TrailerPresence.UNAVAILABLE
    width_m: float | None = None
    longitudinal_acceleration_mps2: float | None = None
    longitudinal_acceleration_confidence_mps2: float | None = None
    curvature_per_m: float | None = None
    curvature_confidence_per_m: float | None = None
    curvature_mode: CurvatureCalculationMode = CurvatureCalculationMode.UNAVAILABLE
    yaw_rate_radps: float | None = None
    yaw_rate_confidence_radps: float | None = None
    acceleration_control: AccelerationControl | None = None
    lane_position: int | None = None
    steering_wheel_rad: float | None = None
    steering_wheel_confidence_rad: float | None = None
    lateral_acceleration_mps2: float | None = None
    lateral_acceleration_confidence_mps2: float | None = None
    vertical_acceleration_mps2: float | None = None
    vertical_acceleration_confidence_mps2: float | None = None
    performance_class: int | None = None
    toll_zone: Any = None
    roadside: Any = None
    low_frequency: LowFrequency | None = None
    special_vehicle: Any = None


class CamCore(NamedTuple):
    """The fields of a CAM that a Local Dynamic Map uses; as in `Cam`."""

    station_id: int
    station_type: int
    generation_delta_time_ms: int
    latitude_deg: float | None
    longitude_deg: float | None
    altitude_m: float | None
    heading_rad: float | None = None
    speed_mps: float | None = None
    length_m: float | None = None
    width_m: float | None = None


def cam_of_state(state: StationState, low_frequency: LowFrequency | None = None) -> Cam:
    """The CAM of a vehicle in this state; it carries the time of the state, not of sending."""
    semi_major_m, semi_minor_m, semi_major_rad = confidence_ellipse(state.east_north_covariance_m2)
    acceleration_confidence = _confidence(state.acceleration_std_mps2)
    lateral, vertical = state.lateral_acceleration_mps2, state.vertical_acceleration_mps2
    return Cam(
        station_id=state.station_id,
        station_type=state.station_type,
        generation_delta_time_ms=generation_delta_time_ms(state.time_ns),
        latitude_deg=state.latitude_deg,
        longitude_deg=state.longitude_deg,
        semi_major_m=semi_major_m,
        semi_minor_m=semi_minor_m,
        semi_major_rad=semi_major_rad,
        altitude_m=state.altitude_m,
        altitude_confidence_m=_confidence(state.altitude_std_m),
        heading_rad=state.heading_rad,
        heading_confidence_rad=_confidence(state.heading_std_rad),
        speed_mps=state.speed_mps,
        speed_confidence_mps=_confidence(state.speed_std_mps),
        drive_direction=state.drive_direction,
        length_m=state.length_m,
        trailer=state.trailer,
        width_m=state.width_m,
        longitudinal_acceleration_mps2=state.longitudinal_acceleration_mps2,
        longitudinal_acceleration_confidence_mps2=acceleration_confidence,
        curvature_per_m=state.curvature_per_m,
        curvature_confidence_per_m=_confidence(state.curvature_std_per_m),
        curvature_mode=state.curvature_mode,
        yaw_rate_radps=state.yaw_rate_radps,
        yaw_rate_confidence_radps=_confidence(state.yaw_rate_std_radps),
        acceleration_control=state.acceleration_control,
        lane_position=state.lane_position,
        steering_wheel_rad=state.steering_wheel_rad,
        lateral_acceleration_mps2=lateral,
        lateral_acceleration_confidence_mps2=None if lateral is None else acceleration_confidence,
        vertical_acceleration_mps2=vertical,
        vertical_acceleration_confidence_mps2=None if vertical is None else acceleration_confidence,
        low_frequency=low_frequency,
    )


def confidence_ellipse(
    east_north_covariance_m2: tuple[float, float, float] | None,
) -> tuple[float, float, float] | tuple[None, None, None]:
    """Semi-axes in metres of the 95 % ellipse, and the major one's direction clockwise from north.

    The axes are the covariance's eigenvectors, in closed form for two dimensions. No axis is
    shorter than a centimetre, the smallest value of a CAM.
    """
    if east_north_covariance_m2 is None:
        return None, None, None
    east_east, east_north, north_north = east_north_covariance_m2
    mean, radius = (east_east + north_north) / 2, math.hypot((east_east - north_north) / 2, east_north)
    from_east_rad = math.atan2(2 * east_north, east_east - north_north) / 2
    semi_major_m = ELLIPSE_SIGMAS_95 * math.sqrt(mean + radius)
    semi_minor_m = ELLIPSE_SIGMAS_95 * math.sqrt(max(mean - radius, 0.0))
    return max(semi_major_m, 0.01), max(semi_minor_m, 0.01), (math.pi / 2 - from_east_rad) % math.pi


def _confidence(std: float | None) -> float | None:
    return None if std is None else SIGMAS_95 * std
