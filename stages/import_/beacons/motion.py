"""What a record says of a vehicle's motion, in SI units and in the frame of the log's map."""

from __future__ import annotations

import math
from typing import NamedTuple

from advpipe.stages.import_.beacons.record import BeaconState

_SLOW_MPS = 0.1
"""Below, a velocity has no direction."""


class Motion(NamedTuple):
    """Position of the middle, yaw from +x to +y, speed along it; NaN for what the record does not say, 0 for
    confidences."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    acceleration_mps2: float
    position_confidence_m: float = 0.0
    speed_confidence_mps: float = 0.0
    heading_confidence_rad: float = 0.0


def motion_of_vectors(state: BeaconState, last_yaw_rad: float = math.nan) -> Motion:
    """Of VeReMi: the heading's vector, or the direction of the velocity where there is none (2018).

    last_yaw_rad: of the vehicle before, for one that stands and whose heading is not told.
    """
    (x_m, y_m, _), velocity = state.position, state.speed
    heading = state.heading
    fast_mps = math.hypot(velocity[0], velocity[1])
    if math.isfinite(heading[0]) and math.hypot(heading[0], heading[1]) > 0:
        yaw_rad = math.atan2(heading[1], heading[0])
    else:
        yaw_rad = math.atan2(velocity[1], velocity[0]) if fast_mps > _SLOW_MPS else last_yaw_rad
    along = (math.cos(yaw_rad), math.sin(yaw_rad)) if math.isfinite(yaw_rad) else (math.nan, math.nan)
    acceleration = state.acceleration[0] * along[0] + state.acceleration[1] * along[1]
    return Motion(
        x_m,
        y_m,
        yaw_rad,
        _signed(fast_mps, velocity[0] * along[0] + velocity[1] * along[1]),
        acceleration,
        _length(state.position_noise),
        _length(state.speed_noise),
        math.radians(_length(state.heading_noise)),
    )


def motion_of_numbers(state: BeaconState) -> Motion:
    """Of VeReMi NextGen: headings are degrees clockwise from north."""
    heading_deg = state.heading[0]
    return Motion(
        state.position[0],
        state.position[1],
        math.remainder(math.radians(90 - heading_deg), math.tau) if math.isfinite(heading_deg) else math.nan,
        state.speed[0],
        state.acceleration[0],
        _length(state.position_noise),
        _length((state.speed_noise[0], 0.0, 0.0)),
        math.radians(_length((state.heading_noise[0], 0.0, 0.0))),
    )


def _signed(size: float, along: float) -> float:
    """A speed is negative where the vehicle drives backwards."""
    return -size if along < 0 else size


def _length(noise: tuple[float, float, float]) -> float:
    """The larger part in the plane; 0 for none."""
    found = [abs(part) for part in noise[:2] if math.isfinite(part)]
    return max(found, default=0.0)
