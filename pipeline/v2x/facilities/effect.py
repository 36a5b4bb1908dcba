"""Whether a falsification has an effect: how far a message or a fix is from the honest one.

Effect-based, as in VeReMi NextGen: a zero-speed report of a standing car is not false. One rule for messages
and
fixes: a station that sends the position of its spoofed receiver sends a false message exactly where the fix
is false.
"""

from __future__ import annotations

import math
from typing import Any

from advpipe.pipeline.v2x.codec.timestamps import GENERATION_DELTA_TIME_CYCLE_MS
from advpipe.pipeline.v2x.facilities.cam_values import Values

POSITION_M = 1.0
THRESHOLDS: dict[str, float] = {
    "speed_mps": 1.0,
    "heading_rad": math.radians(10),
    "longitudinal_acceleration_mps2": 0.5,
    "yaw_rate_radps": math.radians(5),
    "curvature_per_m": 0.01,
    "altitude_m": 5.0,
    "length_m": 0.5,
    "width_m": 0.5,
}
"""A larger difference has an effect, as one above `POSITION_M` on the ground does."""
ALWAYS = ("station_id", "station_type", "acceleration_control")
"""Any difference has an effect."""
_PLACE = ("latitude_deg", "longitude_deg")


def has_effect(true: Values | None, false: Values | None, moved_m: float, expiry_s: float) -> bool:
    """Whether a receiver that trusts `false` has other information than with `true`.

    None stands for bytes that are not a vehicle's CAM. moved_m: distance of the positions on the ground;
    NaN where one of them states none. expiry_s: how long a Local Dynamic Map keeps a message: it discards one
    whose time is wrong by more. A value that only one of them states, or that is out of range, has an effect
    too.
    """
    if true is None or false is None:
        return True
    if moved_m > POSITION_M:
        return True
    if math.isnan(moved_m) and any(true[name] != false[name] for name in _PLACE):
        return True
    if any(true[name] != false[name] for name in ALWAYS):
        return True
    if any(_differs(name, true[name], false[name]) for name in THRESHOLDS):
        return True
    return _time_apart_ms(true, false) > 1000 * expiry_s


def fix_has_effect(east_m: float, north_m: float, up_m: float) -> bool:
    """Whether a fix is so far off that a message with its position has an effect."""
    return math.hypot(east_m, north_m) > POSITION_M or abs(up_m) > THRESHOLDS["altitude_m"]


def _differs(name: str, true: Any, false: Any) -> bool:
    if true == false:
        return False
    if true is None or false is None or math.isinf(true) or math.isinf(false):
        return True
    apart = true - false
    if name == "heading_rad":
        apart = math.remainder(apart, math.tau)
    return bool(abs(apart) > THRESHOLDS[name])


def _time_apart_ms(true: Values, false: Values) -> int:
    cycle_ms = GENERATION_DELTA_TIME_CYCLE_MS
    name = "generation_delta_time_ms"
    apart_ms = (true[name] - false[name]) % cycle_ms
    return int(min(apart_ms, cycle_ms - apart_ms))
