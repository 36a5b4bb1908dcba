"""The baseline: the checks of CaTCH, following the published description of VeReMi NextGen's detector.

Kamel et al., "CaTch: A Confidence Range Tolerant Misbehavior Detection Approach", IEEE WCNC 2019, and
Documentation/Evaluation of VeReMi-dataset/VeReMi-NextGen. Each check returns a factor from 0 to 1: the share
of the values within the message's claimed confidences that is plausible. A message is flagged
if any factor is below one half. Reimplemented from that description. Here the shares are taken along the
line between two places instead of over areas of circles: both pass one half at the same place.

Each message is compared with the previous one of the same station, vectorised over all messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, wrap_angle
from advpipe.pipeline.misbehaviour import checks, tuned
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle

CATCH_CHECKS = (
    *("range", "position", "speed", "position_consistency", "speed_consistency"),
    *("position_speed", "heading", "intersection"),
)
"""The eight checks used in the evaluation, which also left out sudden appearance."""
MAX_INTERSECTION_S = 3.0
"""Boxes of this age count for nothing with any `max_intersection_s` that tuning tries."""


@dataclass(frozen=True, kw_only=True)
class CatchParameters:
    """The baseline's parameters, see `CATCH_MEANINGS`; the defaults lie in the range that NextGen tuned
    to."""

    max_range_m: float = 320.0
    max_speed_mps: float = 40.0
    max_acceleration_mps2: float = 3.2
    max_deceleration_mps2: float = 5.0
    max_heading_change_rad: float = math.radians(90)
    max_intersection_s: float = 2.0
    max_time_s: float = 3.1
    max_off_road_m: float = 2.0
    heading_time_s: float = 1.1
    margin_up_m: float = 2.1
    margin_down_m: float = 6.2
    off_road_speed_mps: float = 1.0


TUNED_CATCH = CatchParameters(**tuned.CATCH)
"""Tuned on the same drives as the thresholds of our own detector."""

CATCH_MEANINGS: dict[str, tuple[str, str, str]] = {
    "max_range_m": ("m", "range", "largest distance at which a message is received"),
    "max_speed_mps": ("m/s", "speed, position_consistency", "largest speed of any vehicle"),
    "max_acceleration_mps2": ("m/s2", "speed_consistency, position_speed", "speeding up"),
    "max_deceleration_mps2": ("m/s2", "speed_consistency, position_speed", "braking"),
    "max_heading_change_rad": ("rad", "heading", "between the direction driven and the claimed heading"),
    "max_intersection_s": ("s", "intersection", "age from which another station's box is ignored"),
    "max_time_s": ("s", "position_speed", "between messages that are compared"),
    "max_off_road_m": ("m", "position", "beside the road"),
    "heading_time_s": ("s", "heading", "between messages that are compared"),
    "margin_up_m": ("m", "position_speed", "beyond the distance that the speeds allow"),
    "margin_down_m": ("m", "position_speed", "below the distance that the speeds require, at standstill"),
    "off_road_speed_mps": ("m/s", "position", "up to this speed a car may be parked"),
}
"""Unit, the checks that use it, and what it bounds."""


@dataclass(frozen=True)
class CatchMessages:
    """Messages of one receiver in order of arrival.

    columns: (M,) each, by field of `Claim`; and `range_m` from the receiver, `elapsed_s` since the station's
    previous message, `overlap`, the share of the smaller box that another station's last box covers, and
    `other_s`, the age of that box. before: (M,), the row of the station's previous message, -1 for its first.
    """

    columns: dict[str, Float64]
    before: npt.NDArray[np.int64]


def catch_messages(claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> CatchMessages:
    """Precompute what the checks need, which does not depend on the parameters."""
    fields = (
        *("x_m", "y_m", "yaw_rad", "speed_mps", "position_m", "speed_confidence_mps"),
        *("heading_confidence_rad", "off_road_m", "length_m", "width_m"),
    )
    columns = {name: np.array([getattr(claim, name) for claim in claims], np.float64) for name in fields}
    at = np.array([(receiver.x_m, receiver.y_m) for receiver in receivers]).reshape(-1, 2)
    columns["range_m"] = np.hypot(columns["x_m"] - at[:, 0], columns["y_m"] - at[:, 1])
    before = np.full(len(claims), -1, np.int64)
    newest: dict[int, int] = {}
    overlap, other_s = np.zeros(len(claims)), np.zeros(len(claims))
    for row, claim in enumerate(claims):
        if not claim.is_cam:
            continue
        before[row] = newest.get(claim.station_id, -1)
        overlap[row], other_s[row] = _overlap(claim, claims, newest)
        newest.pop(claim.station_id, None)  # the dict stays ordered by arrival
        newest[claim.station_id] = row
    columns["overlap"], columns["other_s"] = overlap, other_s
    arrival_s = np.array([claim.arrival_ns for claim in claims], np.int64)
    columns["elapsed_s"] = np.where(before >= 0, (arrival_s - arrival_s[before]) / 1e9, np.nan)
    return CatchMessages(columns, before)


def catch_factors(messages: CatchMessages, parameters: CatchParameters) -> Float64:
    """Factors (M, 8), columns `CATCH_CHECKS`; 1 where a check does not apply."""
    p, now = parameters, messages.columns
    old = {name: np.where(messages.before >= 0, now[name][messages.before], np.nan) for name in now}
    t = np.maximum(now["elapsed_s"], 0.0)
    speed, old_speed = np.abs(now["speed_mps"]), np.abs(old["speed_mps"])
    way_m = np.hypot(now["x_m"] - old["x_m"], now["y_m"] - old["y_m"])
    both_m = now["position_m"] + old["position_m"]
    with np.errstate(invalid="ignore", divide="ignore"):
        factors = [
            _below(now["range_m"], now["position_m"], p.max_range_m),
            _position(now, speed, p),
            _below(speed, now["speed_confidence_mps"] / 2, p.max_speed_mps),
            _below(way_m, both_m, p.max_speed_mps * t),
            _speed_change(now, old, speed - old_speed, t, p),
            _position_speed(now, old, way_m, both_m, t, p),
            _heading(now, old, way_m, speed, t, p),
            1.01 - now["overlap"] * np.clip(1 - now["other_s"] / p.max_intersection_s, 0, 1),
        ]
    table = np.stack(factors, axis=-1)
    return np.where(np.isfinite(table), np.clip(table, 0.0, 1.0), 1.0)


def catch_flags(messages: CatchMessages, parameters: CatchParameters) -> npt.NDArray[np.bool_]:
    """Which messages are flagged, (M,)."""
    is_implausible = (catch_factors(messages, parameters) < 0.5).any(axis=1)
    return np.asarray(is_implausible | ~np.isfinite(messages.columns["x_m"]), np.bool_)


def travel_bounds_m(
    old_mps: Float64, new_mps: Float64, t_s: Float64, faster_mps2: float, slower_mps2: float
) -> tuple[Float64, Float64]:
    """The shortest and longest distance (M,) driven between two speeds in a time, within both accelerations.

    Longest: accelerate fully, then brake; shortest: brake first, then accelerate, and never drive backwards.
    """
    sum_mps2 = faster_mps2 + slower_mps2
    up_s = np.clip((new_mps - old_mps + slower_mps2 * t_s) / sum_mps2, 0, t_s)
    rest_s = t_s - up_s
    top_mps = old_mps + faster_mps2 * up_s
    most_m = (old_mps + top_mps) / 2 * up_s + top_mps * rest_s - slower_mps2 * rest_s**2 / 2
    down_s = np.clip((old_mps - new_mps + faster_mps2 * t_s) / sum_mps2, 0, t_s)
    low_mps = old_mps - slower_mps2 * down_s
    rest_s = t_s - down_s
    least_m = (old_mps + low_mps) / 2 * down_s + low_mps * rest_s + faster_mps2 * rest_s**2 / 2
    # A vehicle that comes to a stop waits: it brakes to zero and accelerates from zero at the end.
    halted_m = old_mps**2 / (2 * slower_mps2) + new_mps**2 / (2 * faster_mps2)
    return np.where(low_mps < 0, halted_m, least_m), most_m


def _below(value: Float64, half_width: Float64, limit: float | Float64) -> Float64:
    """The share of value ± half-width that is below a limit."""
    width = np.maximum(2 * half_width, 1e-9)
    share: Float64 = np.clip((limit - value + half_width) / width, 0.0, 1.0)
    return share


def _position(now: dict[str, Float64], speed: Float64, p: CatchParameters) -> Float64:
    is_parked = np.maximum(speed - now["speed_confidence_mps"], 0) <= p.off_road_speed_mps
    return np.where(is_parked, 1.0, _below(now["off_road_m"], now["position_m"], p.max_off_road_m))


def _speed_change(
    now: dict[str, Float64], old: dict[str, Float64], change: Float64, t: Float64, p: CatchParameters
) -> Float64:
    most = np.where(change > 0, p.max_acceleration_mps2, p.max_deceleration_mps2) * t
    return _below(np.abs(change), now["speed_confidence_mps"] + old["speed_confidence_mps"], most)


def _position_speed(
    now: dict[str, Float64],
    old: dict[str, Float64],
    way_m: Float64,
    both_m: Float64,
    t: Float64,
    p: CatchParameters,
) -> Float64:
    """The mean over three readings of the speeds: as claimed, and shifted by their confidences either way."""
    speed, old_speed = np.abs(now["speed_mps"]), np.abs(old["speed_mps"])
    slowest = np.minimum(speed, old_speed)
    lenient_m = np.maximum(0.0, p.margin_down_m + 0.3571 * slowest - 0.01694 * slowest**2)
    own, before = now["speed_confidence_mps"], old["speed_confidence_mps"]
    mean = (speed + old_speed) / 2
    is_crossed = speed - own < old_speed + before
    readings = (
        (speed, old_speed),
        (speed + own, np.maximum(old_speed - before, 0.0)),
        (np.where(is_crossed, mean, speed - own), np.where(is_crossed, mean, old_speed + before)),
    )
    above, under = [], []
    for new, first in readings:
        least_m, most_m = travel_bounds_m(first, new, t, p.max_acceleration_mps2, p.max_deceleration_mps2)
        above.append(1 - _below(way_m, both_m, least_m - lenient_m))
        under.append(_below(way_m, both_m, most_m + p.margin_up_m))
    factor = np.minimum(np.mean(above, axis=0), np.mean(under, axis=0))
    fastest = np.maximum(speed, old_speed)
    stands = (fastest < 1.0) & (way_m - both_m <= fastest * t)
    return np.where(stands | (t >= p.max_time_s), 1.0, factor)


def _heading(
    now: dict[str, Float64],
    old: dict[str, Float64],
    way_m: Float64,
    speed: Float64,
    t: Float64,
    p: CatchParameters,
) -> Float64:
    moved_rad = np.arctan2(now["y_m"] - old["y_m"], now["x_m"] - old["x_m"])
    off_rad = np.abs(wrap_angle(now["yaw_rad"] - moved_rad))
    # Besides the heading's confidence, the confidence of both positions turns the direction between them.
    turn_rad = np.arctan2(now["position_m"] + old["position_m"], np.maximum(way_m, 1e-9))
    factor = _below(off_rad, now["heading_confidence_rad"] + turn_rad, p.max_heading_change_rad)
    applies = (t < p.heading_time_s) & (way_m >= 1) & (speed - now["speed_confidence_mps"] >= 1)
    return np.where(applies, factor, 1.0)


def _overlap(claim: Claim, claims: Sequence[Claim], newest: dict[int, int]) -> tuple[float, float]:
    """The largest overlap with another station's last claimed box, and the age of that box."""
    own = checks.claimed_box(claim, claim.generation_ns)
    if own is None:
        return 0.0, 0.0
    worst, age_s = 0.0, 0.0
    for station, row in reversed(newest.items()):
        other = claims[row]
        if (claim.arrival_ns - other.arrival_ns) / 1e9 >= MAX_INTERSECTION_S:
            break
        if station == claim.station_id or abs(other.x_m - claim.x_m) + abs(other.y_m - claim.y_m) > 30:
            continue
        box = checks.claimed_box(other, other.generation_ns)
        share = 0.0 if box is None else checks.overlap_share(own, [box])
        if share > worst:
            worst, age_s = share, (claim.arrival_ns - other.arrival_ns) / 1e9
    return worst, age_s
