"""Whether a lie mattered: how far a message, or a fix, is from what an honest one would have said.

Effect-based, as in VeReMi NextGen: a zero-speed report of a standing car is no lie. One rule for messages and
fixes: whoever tells a place that a spoofed receiver gave it lies exactly where the receiver was lied to.
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
"""A difference above it matters, as one above `POSITION_M` on the ground does."""
ALWAYS = ("station_id", "station_type", "acceleration_control")
"""Any difference matters."""
_PLACE = ("latitude_deg", "longitude_deg")


def has_effect(true: Values | None, false: Values | None, moved_m: float, expiry_s: float) -> bool:
    """Whether receivers who believe `false` know something else than with `true`.

    None stands for bytes that are no vehicle's CAM. moved_m: how far the positions are apart on the ground;
    NaN where one of them tells none. expiry_s: how long a Local Dynamic Map keeps a message: one whose time
    is wrong by more is lost to it. A value that is told in one of them only, or out of range, matters too.
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
    """The same of a fix: whether it is that far off as matters in a message that tells it."""
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
