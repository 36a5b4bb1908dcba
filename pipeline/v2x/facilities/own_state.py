"""A station's state from its own estimate, shared by the simulation and by attacks on the estimate."""

from __future__ import annotations

import math
from typing import NamedTuple

from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.v2x.codec.codes import (
    AccelerationControl,
    DriveDirection,
    ExteriorLights,
    TrailerPresence,
)
from advpipe.pipeline.v2x.facilities.reference_point import ReferencePoint
from advpipe.pipeline.v2x.facilities.station_state import StationState

STANDING_MPS = 0.05
BRAKING_MPS2 = -0.5
"""Stronger deceleration than rolling out: the driver brakes."""
PEDAL_MPS2 = 0.1


class Identity(NamedTuple):
    """The fixed properties of a station, independent of its position."""

    station_id: int
    station_type: int
    length_m: float
    width_m: float
    trailer: TrailerPresence


class Accuracy(NamedTuple):
    """Standard deviations (1 sigma) of a station's own estimate; None where unknown."""

    east_north_covariance_m2: tuple[float, float, float]
    altitude_m: float | None
    heading_rad: float
    speed_mps: float
    yaw_rate_radps: float | None


def accuracy_of_estimate(estimate: Estimate) -> Accuracy:
    """The accuracy from the on-board filter's covariance; the map's axes are east and north."""
    pose, twist = estimate.pose_covariance, estimate.twist_covariance
    (east_east, east_north), (_, north_north) = pose[:2, :2].tolist()
    variances = pose[2, 2], pose[5, 5], twist[0, 0], twist[5, 5]
    return Accuracy((east_east, east_north, north_north), *(math.sqrt(value) for value in variances))


def own_state(
    who: Identity,
    time_ns: int,
    place: ReferencePoint,
    accuracy: Accuracy,
    *,
    speed_mps: float,
    acceleration_mps2: float,
    yaw_rate_radps: float,
    lights: ExteriorLights = ExteriorLights.DAYTIME_RUNNING,
) -> StationState:
    """The state from which a CAM is generated; a negative speed is backwards. lights: those that are on."""
    return StationState(
        station_id=who.station_id,
        station_type=who.station_type,
        time_ns=time_ns,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        altitude_m=place.altitude_m,
        heading_rad=place.heading_rad,
        speed_mps=abs(speed_mps),
        drive_direction=DriveDirection.FORWARD if speed_mps >= 0 else DriveDirection.BACKWARD,
        length_m=who.length_m,
        width_m=who.width_m,
        trailer=who.trailer,
        longitudinal_acceleration_mps2=acceleration_mps2,
        lateral_acceleration_mps2=speed_mps * yaw_rate_radps,
        yaw_rate_radps=yaw_rate_radps,
        curvature_per_m=yaw_rate_radps / speed_mps if abs(speed_mps) > STANDING_MPS else 0.0,
        east_north_covariance_m2=accuracy.east_north_covariance_m2,
        altitude_std_m=accuracy.altitude_m,
        heading_std_rad=accuracy.heading_rad,
        speed_std_mps=accuracy.speed_mps,
        yaw_rate_std_radps=accuracy.yaw_rate_radps,
        acceleration_control=_pedals(acceleration_mps2),
        exterior_lights=lights,
    )


def _pedals(acceleration_mps2: float) -> AccelerationControl:
    if acceleration_mps2 < BRAKING_MPS2:
        return AccelerationControl.BRAKE_PEDAL
    return AccelerationControl.GAS_PEDAL if acceleration_mps2 > PEDAL_MPS2 else AccelerationControl.NONE
