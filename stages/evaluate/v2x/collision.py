"""A simple forward-collision warning, fed by the Local Dynamic Map and, for comparison, by the truth.

Rule: warn while the time to collision with anything ahead is below `WARN_S`. A road user is ahead if its
centre is at most `AHEAD_M` in front of the vehicle and both boxes overlap laterally, seen along the vehicle's
heading. Time to collision is the gap between both boxes along that heading, divided by the closing speed
where this is above `CLOSING_MPS`; speeds are taken as constant. Lanes and turns are ignored, as in the
simplest such systems.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.results.v2x import Warnings
from advpipe.stages.evaluate.v2x.ldm_error import Known, Moment

WARN_S = 2.5
AHEAD_M = 100.0
CLOSING_MPS = 0.5
TOGETHER_S = 1.0
"""Warnings at most this far apart are one alarm; an alarm and a danger at most this far apart match."""


def time_to_collision_s(own: Known, other: Known) -> float:
    """Time to collision with another road user; infinite if it is not ahead or not approached."""
    cosine, sine = math.cos(own.yaw_rad), math.sin(own.yaw_rad)
    x_m, y_m = other.x_m - own.x_m, other.y_m - own.y_m
    ahead_m, aside_m = cosine * x_m + sine * y_m, cosine * y_m - sine * x_m
    turn_rad = other.yaw_rad - own.yaw_rad
    if not math.isfinite(ahead_m + turn_rad + other.speed_mps + other.length_m + other.width_m):
        return math.inf
    along, across = abs(math.cos(turn_rad)), abs(math.sin(turn_rad))
    half_length_m = (along * other.length_m + across * other.width_m) / 2
    half_width_m = (across * other.length_m + along * other.width_m) / 2
    closing_mps = own.speed_mps - other.speed_mps * math.cos(turn_rad)
    if not 0 < ahead_m <= AHEAD_M or abs(aside_m) >= half_width_m + own.width_m / 2:
        return math.inf
    if closing_mps <= CLOSING_MPS:
        return math.inf
    return max(ahead_m - half_length_m - own.length_m / 2, 0.0) / closing_mps


def known_of_radio(radio: RadioPlace) -> Known:
    """The true state of a station in the form of a map entry."""
    pose = radio.map_SE3_base
    return Known(
        radio.station_id,
        float(pose[0, 3]),
        float(pose[1, 3]),
        math.atan2(pose[1, 0], pose[0, 0]),
        float(pose[:3, 0] @ radio.velocity_mps),
        radio.size_m[0],
        radio.size_m[1],
    )


def warnings(moments: Sequence[Moment], own: Sequence[Known] | None = None) -> Warnings:
    """Run the collision warning over a drive.

    own: the vehicle's estimate of its own state at each moment, by default the truth. Only stations with
    radios count as dangers: the map cannot hold the others.
    """
    times_s = np.array([moment.time_ns for moment in moments], np.int64) / 1e9
    step_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    alarm, danger = np.zeros(len(moments), bool), np.zeros(len(moments), bool)
    for index, moment in enumerate(moments):
        truth = known_of_radio(moment.own)
        self = truth if own is None else own[index]
        alarm[index] = _warns(self, (e for e in moment.entries if e.station_id != truth.station_id))
        danger[index] = _warns(truth, map(known_of_radio, moment.others))
    alarms, dangers = _time_spans(times_s[alarm]), _time_spans(times_s[danger])
    false_alarms = [span for span in alarms if not _near_any(span, dangers)]
    return Warnings(
        len(alarms),
        len(dangers),
        len(false_alarms),
        sum(not _near_any(span, alarms) for span in dangers),
        float(alarm.sum()) * step_s,
        float(danger.sum()) * step_s,
        sum(last_s - first_s + step_s for first_s, last_s in false_alarms),
    )


def _warns(own: Known, others: Iterable[Known]) -> bool:
    return any(time_to_collision_s(own, other) < WARN_S for other in others)


def _time_spans(times_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[tuple[float, float]]:
    """First and last of each run of times that are at most `TOGETHER_S` apart."""
    spans: list[tuple[float, float]] = []
    for time_s in times_s.tolist():
        if spans and time_s - spans[-1][1] <= TOGETHER_S:
            spans[-1] = spans[-1][0], time_s
        else:
            spans.append((time_s, time_s))
    return spans


def _near_any(span: tuple[float, float], others: Sequence[tuple[float, float]]) -> bool:
    return any(
        span[0] <= last_s + TOGETHER_S and first_s <= span[1] + TOGETHER_S for first_s, last_s in others
    )
