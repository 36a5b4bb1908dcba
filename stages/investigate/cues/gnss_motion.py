"""GNSS against wheels and gyroscope: the way between two fixes is the way that the wheels have driven."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import yaw_of
from advpipe.pipeline.localisation.section import GnssSensor, WheelOdometrySensor
from advpipe.stages.investigate.cue import GNSS, Cue, CueReading
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.observations import Observations
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

WINDOWS_S = (1.0, 3.0, 10.0)
HEADING_RAD = 0.02
"""Of the vehicle's own heading, one standard deviation beside what it states, which turns the driven way."""
FLOOR_M = 0.1


class _Mark(NamedTuple):
    """A fix on the map, the pose of dead reckoning at it, the way driven, and the estimated heading."""

    time_ns: int
    fix_m: tuple[float, float]
    reckoned_m: tuple[float, float]
    reckoned_rad: float
    way_m: float
    yaw_rad: float
    yaw_stddev_rad: float


class GnssMotionCue(Cue):
    """By how many standard deviations the way between two fixes differs from dead reckoning.

    The errors are those that receivers and wheels usually have (`pipeline/localisation/section.py`): a drift
    that the single fix hides shows over ten seconds.
    """

    needs = (EvidenceKind.FIXES, EvidenceKind.WHEELS, EvidenceKind.ESTIMATE)
    meaning = "the way between fixes against the way of wheels and gyroscope"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._marks: deque[_Mark] = deque()
        self._x_m = self._y_m = self._yaw_rad = self._way_m = 0.0
        self._last_ns: int | None = None

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        self._advance(situation.observed)
        geodesy = self._background.geodesy
        if geodesy is None or situation.pose is None or not situation.observed.fixes:
            return
        fix = situation.observed.fixes[-1]
        x_m, y_m, _ = geodesy.to_map(fix.geographic).tolist()
        now = _Mark(
            *(fix.time_ns, (x_m, y_m), (self._x_m, self._y_m), self._yaw_rad, self._way_m),
            yaw_of(situation.pose.map_SE3_base),
            situation.pose.yaw_stddev_rad,
        )
        self._marks.append(now)
        while now.time_ns - self._marks[0].time_ns > WINDOWS_S[-1] * 1e9:
            self._marks.popleft()
        found = [_contradiction(first, now) for first in self._firsts(now)]
        if found:
            sigmas, words = max(found)
            yield CueReading(GNSS, now.time_ns, sigmas, words)

    def _firsts(self, now: _Mark) -> Iterator[_Mark]:
        """The mark at the beginning of each window that has begun."""
        for window_s in WINDOWS_S:
            first = next(
                (one for one in self._marks if now.time_ns - one.time_ns <= window_s * 1e9 + 1e6), now
            )
            if now.time_ns - first.time_ns >= 0.5e9 * window_s:
                yield first

    def _advance(self, observed: Observations) -> None:
        elapsed_s = 0.0 if self._last_ns is None else (observed.time_ns - self._last_ns) / 1e9
        self._last_ns = observed.time_ns
        if not observed.twists or not elapsed_s < 1.0:
            self._marks.clear()  # the wheels were silent: what was before cannot be compared
            return
        speed_mps = float(np.mean([one.speed_mps for one in observed.twists]))
        rates = [float(one.angular_rate_radps[2]) for one in observed.inertia]
        turn = float(np.mean(rates or [one.turn_rate_radps for one in observed.twists])) * elapsed_s
        way_m, middle_rad = speed_mps * elapsed_s, self._yaw_rad + turn / 2
        self._x_m += way_m * math.cos(middle_rad)
        self._y_m += way_m * math.sin(middle_rad)
        self._yaw_rad += turn
        self._way_m += abs(way_m)


def _contradiction(first: _Mark, now: _Mark) -> tuple[float, str]:
    elapsed_s, way_m = (now.time_ns - first.time_ns) / 1e9, now.way_m - first.way_m
    turn_rad = first.yaw_rad - first.reckoned_rad
    x_m, y_m = now.reckoned_m[0] - first.reckoned_m[0], now.reckoned_m[1] - first.reckoned_m[1]
    driven_m = (
        math.cos(turn_rad) * x_m - math.sin(turn_rad) * y_m,
        math.sin(turn_rad) * x_m + math.cos(turn_rad) * y_m,
    )
    fixes_m = now.fix_m[0] - first.fix_m[0], now.fix_m[1] - first.fix_m[1]
    off_m = math.hypot(fixes_m[0] - driven_m[0], fixes_m[1] - driven_m[1])
    receiver, wheels = GnssSensor(), WheelOdometrySensor()
    wander_m2 = 2 * receiver.drift_stddev_m**2 * (1 - math.exp(-elapsed_s / receiver.drift_time_s))
    sigma_m = math.sqrt(
        FLOOR_M**2
        + 2 * receiver.white_stddev_m**2
        + wander_m2
        + (wheels.speed_scale_stddev**2 + HEADING_RAD**2 + first.yaw_stddev_rad**2) * way_m**2
    )
    words = (
        f"in {elapsed_s:.1f} s the fixes moved {math.hypot(*fixes_m):.1f} m and the wheels {way_m:.1f} m: "
        f"{off_m:.1f} m apart, {off_m / sigma_m:.1f} standard deviations"
    )
    return off_m / sigma_m, words
