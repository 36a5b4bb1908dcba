"""Which messages NextGen's generator labels as false, where it does not label all that it touches."""

from __future__ import annotations

import math

from advpipe.pipeline.v2x.facilities.cam_values import Values
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m

LEAST_MPS, LEAST_MOVED_M, FAR_M = 1.0, 1.0, 20.0
LEAST_BRAKING_MPS2, LEAST_ACCELERATION_MPS2 = 0.25, 0.5
_ACCELERATION = "longitudinal_acceleration_mps2"


def of_moving_station(true: Values, false: Values, last: Values | None) -> bool:
    """Zero speed, reversed heading: it is faster than 1 m/s, and has moved by more than 1 m since its last
    message."""
    return _value(true, "speed_mps") > LEAST_MPS and (last is None or _apart_m(last, true) > LEAST_MOVED_M)


def of_slower_claim(true: Values, false: Values, last: Values | None) -> bool:
    """Sudden constant speed: it is faster than it claims by more than 1 m/s."""
    return _value(true, "speed_mps") - _value(false, "speed_mps") > LEAST_MPS


def of_feigned_stop(true: Values, false: Values, last: Values | None) -> bool:
    """Sudden stop: it is faster than 1 m/s, and at the first message does not brake, or it is at least 20 m
    from where it claims to stand."""
    apart_m, is_moving = _apart_m(true, false), _value(true, "speed_mps") > LEAST_MPS
    if apart_m == 0:
        return is_moving and _value(true, _ACCELERATION) >= 0
    return is_moving or apart_m >= FAR_M


def of_accelerating_station(true: Values, false: Values, last: Values | None) -> bool:
    """Feigned braking: it accelerates by more than 0.25 m/s²."""
    return _value(true, _ACCELERATION) > LEAST_BRAKING_MPS2


def of_changing_speed(true: Values, false: Values, last: Values | None) -> bool:
    """Multiplied acceleration: it is more than 0.5 m/s² either way."""
    return abs(_value(true, _ACCELERATION)) > LEAST_ACCELERATION_MPS2


def _value(claims: Values, name: str) -> float:
    """A value, 0 where the message does not state it."""
    return float(claims[name] or 0.0)


def _apart_m(one: Values, other: Values) -> float:
    places = [claims[name] for claims in (one, other) for name in ("latitude_deg", "longitude_deg")]
    if any(degrees is None or not math.isfinite(degrees) for degrees in places):
        return 0.0
    return math.hypot(*east_north_m(*places))
