"""A vehicle's past path as a few points, for the low-frequency container."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from advpipe.pipeline.v2x.facilities.cam import MAX_PATH_POINTS, PathPoint
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m

ALLOWABLE_ERROR_M = 0.47
"""Maximum distance of a past position from the line through the path points."""
MAX_CHORD_M = 22.5
MIN_LENGTH_M = 200.0
"""Minimum length of the path history, once the vehicle has driven that far. All three from the Car 2 Car
profile."""

MAX_DELTA_STEPS = 131_071
_HALF_TURN_STEPS = 1_800_000_000
_MAX_TICKS = 65_535
_MIN_MOVE_M = 0.2


class _Place(NamedTuple):
    time_ns: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None


class PathHistory:
    """Concise points of a path, chosen while driving, at the same small cost for every position.

    Of the positions since the last point only a wedge is kept: the directions from that point in which a
    line passes all of them within `ALLOWABLE_ERROR_M` (the cone intersection of Williams 1978 and of
    Sklansky and Gonzalez 1980). A position outside of the wedge, or a chord that grows too long, makes
    the position before it a point.
    """

    def __init__(self) -> None:
        self._points: deque[_Place] = deque(maxlen=MAX_PATH_POINTS + 1)
        self._steps: deque[_Step] = deque(maxlen=MAX_PATH_POINTS + 1)  # from each point to the one before it
        self._latest: _Place | None = None
        self._reach_m = 0.0
        self._wedge: tuple[float, float, float] | None = None  # middle, and limits relative to it

    def add(
        self, time_ns: int, latitude_deg: float, longitude_deg: float, altitude_m: float | None = None
    ) -> None:
        """Add the vehicle's next position; times ascend."""
        place = _Place(time_ns, latitude_deg, longitude_deg, altitude_m)
        if self._latest is None:
            self._append(place)
            self._latest = place
        elif _distance_m(self._latest, place) >= _MIN_MOVE_M:
            if not self._fits(place):
                self._append(self._latest)
                self._reach_m, self._wedge = 0.0, None
                self._fits(place)
            self._latest = place

    def points(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float | None, time_ns: int
    ) -> tuple[PathPoint, ...]:
        """The path that leads to a reference position, latest point first; at most 23.

        It is coded in whole steps of the CAM, each relative to the position that a receiver decodes, so that
        rounding does not add up.
        """
        points: list[PathPoint] = []
        before, step = _Place(time_ns, latitude_deg, longitude_deg, altitude_m), None
        length_m = 0.0
        for place, next_step in zip(reversed(self._points), reversed(self._steps), strict=True):
            if _ticks(place.time_ns) >= _ticks(before.time_ns):
                step = None
                continue  # the reference position itself
            delta, step_m = step or _step(before, place)
            if delta is None or len(points) == MAX_PATH_POINTS or length_m >= MIN_LENGTH_M:
                break
            points.append(delta)
            length_m += step_m
            before, step = place, next_step
        return tuple(points)

    def _append(self, place: _Place) -> None:
        self._steps.append(_step(place, self._points[-1]) if self._points else (None, 0.0))
        self._points.append(place)

    def _fits(self, place: _Place) -> bool:
        """Whether a line from the last point to `place` passes all positions since; narrows the wedge."""
        east_m, north_m = _offset_m(self._points[-1], place)
        distance_m = math.hypot(east_m, north_m)
        if distance_m > MAX_CHORD_M and self._reach_m > 0:
            return False
        if distance_m < self._reach_m - ALLOWABLE_ERROR_M:  # turned back
            return False
        self._reach_m = max(self._reach_m, distance_m)
        if distance_m <= ALLOWABLE_ERROR_M:
            return True
        direction_rad = math.atan2(east_m, north_m)
        half_rad = math.asin(ALLOWABLE_ERROR_M / distance_m)
        if self._wedge is None:
            self._wedge = direction_rad, -half_rad, half_rad
            return True
        middle_rad, low_rad, high_rad = self._wedge
        off_rad = math.remainder(direction_rad - middle_rad, math.tau)
        if not low_rad <= off_rad <= high_rad:
            return False
        self._wedge = middle_rad, max(low_rad, off_rad - half_rad), min(high_rad, off_rad + half_rad)
        return True


_Step = tuple[PathPoint | None, float]


def _step(before: _Place, place: _Place) -> _Step:
    """The path point from one position to an earlier one, and the distance in metres."""
    return _delta(before, place), _distance_m(before, place)


def _offset_m(origin: _Place, place: _Place) -> tuple[float, float]:
    return east_north_m(origin.latitude_deg, origin.longitude_deg, place.latitude_deg, place.longitude_deg)


def _distance_m(origin: _Place, place: _Place) -> float:
    return math.hypot(
        *east_north_m(origin.latitude_deg, origin.longitude_deg, place.latitude_deg, place.longitude_deg)
    )


def _delta(before: _Place, place: _Place) -> PathPoint | None:
    """The path point from one position to an earlier one; None where it is too far."""
    north = round(place.latitude_deg * 1e7) - round(before.latitude_deg * 1e7)
    east = round(place.longitude_deg * 1e7) - round(before.longitude_deg * 1e7)
    east = (east + _HALF_TURN_STEPS) % (2 * _HALF_TURN_STEPS) - _HALF_TURN_STEPS  # over the date line
    if max(abs(north), abs(east)) > MAX_DELTA_STEPS:
        return None
    up = None
    if before.altitude_m is not None and place.altitude_m is not None:
        up = round(place.altitude_m * 100) - round(before.altitude_m * 100)
    ticks = _ticks(before.time_ns) - _ticks(place.time_ns)
    return PathPoint(
        north / 1e7,
        east / 1e7,
        None if up is None or not -12_700 <= up < 12_800 else up / 100,
        ticks / 100 if ticks <= _MAX_TICKS else None,
    )


def _ticks(time_ns: int) -> int:
    """Tens of milliseconds, the unit of pathDeltaTime."""
    return (time_ns + 5_000_000) // 10_000_000
