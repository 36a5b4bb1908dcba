"""The baseline: the checks of CaTCH, as VeReMi NextGen's evaluation has them.

Kamel et al., "CaTch: A Confidence Range Tolerant Misbehavior Detection Approach", IEEE WCNC 2019, and
`Generator/MBD_systems` of VeReMi-dataset/VeReMi-NextGen at 1643972f, reimplemented array by array. Each check
returns a factor from 0 to 1: the share of the values within the message's claimed confidences that is
plausible. A message is flagged if any factor is below one half.

A message is compared with the one of the same station that was generated last before it, whenever that
arrived. A CAM's 95 % half-widths are its confidences; in the data set these are the errors themselves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, wrap_angle
from advpipe.pipeline.misbehaviour import tuned
from advpipe.pipeline.misbehaviour.catch_boxes import OtherBoxes
from advpipe.pipeline.misbehaviour.catch_shares import (
    segment_area,
    share_above,
    share_below,
    share_of_intervals,
    share_within,
)
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.verdicts import CheckVerdicts, Verdicts

CATCH_CHECKS = (
    *("range", "position", "speed", "position_consistency", "speed_consistency"),
    *("position_speed", "heading", "intersection"),
)
"""The eight checks used in the evaluation, which also left out sudden appearance."""


@dataclass(frozen=True, kw_only=True)
class CatchParameters:
    """The baseline's parameters, see `CATCH_MEANINGS`."""

    max_range_m: float
    max_off_road_m: float
    max_speed_mps: float
    max_acceleration_mps2: float
    max_deceleration_mps2: float
    max_heading_change_rad: float
    max_intersection_s: float
    max_time_s: float
    heading_time_s: float
    margin_up_m: float
    margin_down_m: float
    off_road_speed_mps: float


def _published(*values: float) -> CatchParameters:
    """A column of the published table, in its order and units."""
    mpr, mpdn, mps, mpa, mpd, mhc_deg, mdi, mtd, pht, mmru, mmrd, mnrs = values
    return CatchParameters(
        max_range_m=mpr,
        max_off_road_m=-mpdn,
        max_speed_mps=mps,
        max_acceleration_mps2=mpa,
        max_deceleration_mps2=mpd,
        max_heading_change_rad=math.radians(mhc_deg),
        max_intersection_s=mdi,
        max_time_s=mtd,
        heading_time_s=pht,
        margin_up_m=mmru,
        margin_down_m=mmrd,
        off_road_speed_mps=mnrs,
    )


PUBLISHED_CATCH: Mapping[str, CatchParameters] = MappingProxyType(
    {
        "urban-2am": _published(
            *(336.568, -1.793, 57.338, 3.121, 4.569, 71.385, 4.697, 3.666, 1.415, 1.118, 2.584, 0.051)
        ),
        "urban-7am": _published(
            *(328.469, -2.144, 30.007, 3.120, 5.091, 111.710, 1.242, 3.618, 4.384, 1.182, 2.137, 0.000)
        ),
        "highway-2am": _published(
            *(309.270, -2.742, 56.064, 3.138, 6.131, 115.995, 3.757, 1.538, 1.837, 1.168, 2.902, 0.490)
        ),
        "highway-7am": _published(
            *(321.918, -3.813, 55.620, 3.429, 4.849, 129.867, 4.906, 3.539, 3.232, 1.123, 1.438, 0.265)
        ),
    }
)
"""What NextGen published for each of its four simulations; the first one has the published F1."""

BOUNDED_CATCH = CatchParameters(**tuned.CATCH_BOUNDED)
"""Tuned on the same drives and with the same bound on false positives as our own detector."""
F1_CATCH = CatchParameters(**tuned.CATCH_F1)
"""Tuned on the same drives for F1 alone, as NextGen did."""

CATCH_MEANINGS: dict[str, tuple[str, str, str]] = {
    "max_range_m": ("m", "range", "largest distance at which a message is received"),
    "max_off_road_m": ("m", "position", "beside the road"),
    "max_speed_mps": ("m/s", "speed, position_consistency", "largest speed of any vehicle"),
    "max_acceleration_mps2": ("m/s2", "speed_consistency, position_speed", "speeding up"),
    "max_deceleration_mps2": ("m/s2", "speed_consistency, position_speed", "braking"),
    "max_heading_change_rad": (
        *("rad", "heading", "between motion and claimed heading, where positions are certain"),
    ),
    "max_intersection_s": ("s", "intersection", "age from which another station's box is ignored"),
    "max_time_s": ("s", "position_speed", "between messages that are compared"),
    "heading_time_s": ("s", "heading", "between messages that are compared"),
    "margin_up_m": ("m", "position_speed", "beyond the distance that the speeds allow"),
    "margin_down_m": ("m", "position_speed", "below the distance that the speeds require, at standstill"),
    "off_road_speed_mps": ("m/s", "position", "up to this speed a car may be parked"),
}
"""Unit, the checks that use it, and what it bounds."""

_FIELDS = (
    *("x_m", "y_m", "yaw_rad", "speed_mps", "position_m", "speed_confidence_mps"),
    *("heading_confidence_rad", "off_road_m"),
)
_SLOW_MPS, _NEAR_M = 1.0, 1.0


@dataclass(frozen=True)
class CatchMessages:
    """Messages of one receiver in order of arrival.

    now: (M,) each, by field of `Claim`, and `range_m` and `own_m`, the distance from the receiver and its own
    confidence. old: the same of the station's message before, NaN without one. elapsed_s: (M,), between the
    generation of the two. boxes: of other stations.
    """

    now: dict[str, Float64]
    old: dict[str, Float64]
    elapsed_s: Float64
    boxes: OtherBoxes


def catch_messages(claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> CatchMessages:
    """Precompute what the checks need, which does not depend on the parameters."""
    now = {name: np.array([getattr(claim, name) for claim in claims], np.float64) for name in _FIELDS}
    now["speed_mps"] = np.abs(now["speed_mps"])
    at = np.array([(receiver.x_m, receiver.y_m) for receiver in receivers]).reshape(-1, 2)
    now["range_m"] = np.hypot(now["x_m"] - at[:, 0], now["y_m"] - at[:, 1])
    now["own_m"] = np.array([receiver.position_m for receiver in receivers], np.float64)
    before = _before(claims)
    old = {name: np.where(before >= 0, values[before], np.nan) for name, values in now.items()}
    sent_s = np.array([claim.generation_ns for claim in claims], np.int64)
    elapsed_s = np.where(before >= 0, (sent_s - sent_s[before]) / 1e9, np.nan)
    return CatchMessages(now, old, elapsed_s, OtherBoxes(claims))


def catch_factors(messages: CatchMessages, parameters: CatchParameters) -> Float64:
    """Factors (M, 8), columns `CATCH_CHECKS`; 1 where a check does not apply."""
    p, now, old, t = parameters, messages.now, messages.old, messages.elapsed_s
    way_m = np.hypot(now["x_m"] - old["x_m"], now["y_m"] - old["y_m"])
    full_m = np.full(len(t), p.max_range_m)
    with np.errstate(invalid="ignore", divide="ignore"):
        factors = [
            share_within(now["range_m"], now["position_m"], now["own_m"], full_m),
            _position(now, p),
            _speed(now, p),
            share_within(way_m, now["position_m"], old["position_m"], p.max_speed_mps * t),
            _speed_change(now, old, t, p),
            _position_speed(now, old, way_m, t, p),
            _heading(now, old, way_m, t, p),
            messages.boxes.factors(len(t), p.max_intersection_s),
        ]
    table = np.stack(factors, axis=-1)
    table[:, 3:7][~np.isfinite(way_m)] = 1.0  # nothing to compare with
    return np.where(np.isfinite(table), np.clip(table, 0.0, 1.0), 1.0)


def catch_flags(messages: CatchMessages, parameters: CatchParameters) -> npt.NDArray[np.bool_]:
    """Which messages are flagged, (M,); one without a position is."""
    is_implausible = (catch_factors(messages, parameters) < 0.5).any(axis=1)
    return np.asarray(is_implausible | ~np.isfinite(messages.now["x_m"]), np.bool_)


def travel_bounds_m(
    old_mps: Float64, new_mps: Float64, t_s: Float64, faster_mps2: float, slower_mps2: float
) -> tuple[Float64, Float64]:
    """The shortest and longest distance (M,) driven between two speeds in a time.

    The mean speed's, and by the published rule 2 to 10 % more or less with the acceleration that the speeds
    require, at most by what the accelerations allow, and at most 1 or 2 m where the speeds differ little.
    """
    new, old = np.maximum(new_mps, 0.0), np.maximum(old_mps, 0.0)
    mean = (new + old) / 2
    base, change = mean * t_s, np.abs(new - old)
    required = change / t_s
    share = np.select(
        [required < 1.0, required < 2.5, required < 5.0],
        [np.full_like(required, 0.02), 0.03 + (required - 1.0) * 0.02, 0.05 + (required - 2.5) * 0.02],
        0.10,
    )
    spread = base * share * np.where(mean > 30, 0.7, np.where(mean > 20, 0.85, 1.0))
    least = np.maximum(base - np.minimum(spread, 0.25 * slower_mps2 * t_s**2), 0.0)
    most = base + np.minimum(spread, 0.25 * faster_mps2 * t_s**2)
    most_apart = np.where(change < 1.0, 1.0, np.where(change < 3.0, 2.0, np.inf))
    return np.maximum(least, base - most_apart), np.minimum(most, base + most_apart)


def _before(claims: Sequence[Claim]) -> npt.NDArray[np.int64]:
    """The row of the station's message that was generated last before each (M,); -1 for its first."""
    before = np.full(len(claims), -1, np.int64)
    by_station: dict[int, list[int]] = {}
    for row, claim in enumerate(claims):
        if claim.is_cam:
            by_station.setdefault(claim.station_id, []).append(row)
    for rows in by_station.values():
        rows.sort(key=lambda row: claims[row].generation_ns)
        last, last_ns, previous = -1, claims[rows[0]].generation_ns, -1
        for row in rows:
            if claims[row].generation_ns > last_ns:
                previous, last_ns = last, claims[row].generation_ns
            before[row], last = previous, row
    return before


def _position(now: dict[str, Float64], p: CatchParameters) -> Float64:
    """The share of the claimed circle that is not farther from the road than allowed."""
    slowest = np.maximum(now["speed_mps"] - now["speed_confidence_mps"], 0.0)
    radius, spare_m = now["position_m"], p.max_off_road_m - now["off_road_m"]
    share = segment_area(radius, radius + spare_m) / (np.pi * radius**2)
    share = np.where(radius > 0, share, (spare_m >= 0).astype(np.float64))
    share = np.where(
        spare_m >= radius, 1.0, np.where(spare_m <= -radius, np.where(radius > 0, 0.0, share), share)
    )
    share = np.where(np.isnan(spare_m), np.nan, share)
    return np.where(slowest <= p.off_road_speed_mps, 1.0, share)


def _speed(now: dict[str, Float64], p: CatchParameters) -> Float64:
    width = now["speed_confidence_mps"]
    over = now["speed_mps"] - p.max_speed_mps
    share = np.where(width > 0, (width / 2 - over) / width, (over < 0).astype(np.float64))
    return np.where(np.isnan(over), np.nan, np.clip(share, 0.0, 1.0))


def _speed_change(
    now: dict[str, Float64], old: dict[str, Float64], t: Float64, p: CatchParameters
) -> Float64:
    change = now["speed_mps"] - old["speed_mps"]
    most = np.where(change > 0, p.max_acceleration_mps2, p.max_deceleration_mps2) * t
    widths = now["speed_confidence_mps"], old["speed_confidence_mps"]
    return np.where(np.isnan(change), np.nan, share_of_intervals(np.abs(change), *widths, most))


def _position_speed(
    now: dict[str, Float64], old: dict[str, Float64], way_m: Float64, t: Float64, p: CatchParameters
) -> Float64:
    """The mean over three readings of the speeds: as claimed, and shifted by their confidences either way."""
    speed, old_speed = now["speed_mps"], old["speed_mps"]
    own, before = now["speed_confidence_mps"], old["speed_confidence_mps"]
    radii = now["position_m"], old["position_m"]
    slowest = np.minimum(speed, old_speed)
    lenient_m = np.maximum(p.margin_down_m + 0.3571 * slowest - 0.01694 * slowest**2, 0.0)
    mean = (speed + old_speed) / 2
    is_crossed = speed - own < old_speed + before
    readings = (
        (speed, old_speed),
        (np.where(is_crossed, mean, speed - own), np.where(is_crossed, mean, old_speed + before)),
        (speed + own, old_speed - before),
    )
    above, under = [], []
    for number, (new, first) in enumerate(readings):
        least_m, most_m = travel_bounds_m(first, new, t, p.max_acceleration_mps2, p.max_deceleration_mps2)
        under.append(share_below(way_m, *radii, most_m + p.margin_up_m))
        # The published code takes the reading of the fastest change without a margin, by another rule.
        strict = number == 2
        above.append(
            1 - share_within(way_m, *radii, least_m)
            if strict
            else share_above(way_m, *radii, least_m - lenient_m)
        )
    factor = np.minimum(np.mean(above, axis=0), np.mean(under, axis=0))
    fastest = np.maximum(speed, old_speed)
    stands = (fastest < _SLOW_MPS) & (way_m - radii[0] - radii[1] <= fastest * t)
    return np.where(stands | (t >= p.max_time_s), 1.0, factor)


def _heading(
    now: dict[str, Float64], old: dict[str, Float64], way_m: Float64, t: Float64, p: CatchParameters
) -> Float64:
    """The mean share of both claimed circles that lies ahead, at both ends of the heading's confidence."""
    moved_rad = np.arctan2(now["y_m"] - old["y_m"], now["x_m"] - old["x_m"])
    off_rad = np.abs(wrap_angle(now["yaw_rad"] - moved_rad))
    half = now["heading_confidence_rad"]
    shares = []
    for angle in (np.maximum(off_rad - half, 0.0), np.minimum(off_rad + half, np.pi)):
        ahead_m = way_m * np.cos(angle)
        certain = (angle <= p.max_heading_change_rad).astype(np.float64)
        for radius, height, is_rest in (
            (now["position_m"], now["position_m"] + ahead_m, False),
            (old["position_m"], old["position_m"] - ahead_m, True),
        ):
            share = segment_area(radius, height) / (np.pi * radius**2)
            shares.append(np.where(radius > 0, 1 - share if is_rest else share, certain))
    factor = np.mean(shares, axis=0)
    is_fast = now["speed_mps"] - now["speed_confidence_mps"] >= _SLOW_MPS
    applies = (t < p.heading_time_s) & (way_m >= _NEAR_M) & is_fast
    return np.where(applies, factor, 1.0)


class CatchDetector:
    """The checks with some parameters, as a misbehaviour detector.

    The score of a check is 1 minus its factor, that of a message the largest one, and 1 where it states no
    position.
    """

    def __init__(self, parameters: CatchParameters) -> None:
        self.parameters = parameters

    def judge(self, claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> Verdicts:
        messages = _messages(tuple(claims), tuple(receivers))
        scores = 1 - catch_factors(messages, self.parameters)
        flagged = scores > 0.5
        is_whole = np.isfinite(messages.now["x_m"])
        return Verdicts(
            np.where(is_whole, scores.max(axis=1, initial=0.0), 1.0),
            flagged.any(axis=1) | ~is_whole,
            {name: CheckVerdicts(scores[:, n], flagged[:, n]) for n, name in enumerate(CATCH_CHECKS)},
        )


@lru_cache(maxsize=1)
def _messages(claims: tuple[Claim, ...], receivers: tuple[ReceivingVehicle, ...]) -> CatchMessages:
    """What detectors of different parameters need of the same messages is computed once."""
    return catch_messages(claims, receivers)
