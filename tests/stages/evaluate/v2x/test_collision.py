"""The warning's rule, by hand, and what it is compared with."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.stages.evaluate.v2x.collision import time_to_collision_s, warnings
from advpipe.stages.evaluate.v2x.ldm_error import Known, Moment

OWN = Known(1, 0.0, 0.0, 0.0, 15.0, 4.0, 2.0)


def other(x_m: float, y_m: float = 0.0, speed_mps: float = 5.0, yaw_rad: float = 0.0) -> Known:
    return Known(2, x_m, y_m, yaw_rad, speed_mps, 4.0, 2.0)


def test_time_to_collision() -> None:
    """24 m between the middles, half a length of each: 20 m at 10 m/s."""
    assert time_to_collision_s(OWN, other(24.0)) == pytest.approx(2.0)
    assert time_to_collision_s(OWN, other(24.0, speed_mps=15.0)) == math.inf  # as fast
    assert time_to_collision_s(OWN, other(-24.0)) == math.inf  # behind
    assert time_to_collision_s(OWN, other(24.0, y_m=2.1)) == math.inf  # beside
    assert time_to_collision_s(OWN, other(24.0, y_m=1.9)) == pytest.approx(2.0)
    assert time_to_collision_s(OWN, other(3.0)) == 0.0  # on top of each other
    # Oncoming: both speeds count.
    assert time_to_collision_s(OWN, other(24.0, yaw_rad=math.pi)) == pytest.approx(1.0)
    # Across the road: half a width instead of half a length, and none of its speed.
    assert time_to_collision_s(OWN, other(23.0, y_m=2.9, yaw_rad=math.pi / 2)) == pytest.approx(20 / 15)
    assert time_to_collision_s(OWN, other(24.0, speed_mps=math.nan)) == math.inf


def moment(nth: int, entry_x_m: float | None, truth_x_m: float | None) -> Moment:
    def radio(station_id: int, x_m: float, speed_mps: float) -> RadioPlace:
        velocity = np.array([speed_mps, 0.0, 0.0])
        return RadioPlace(station_id, "ego", se3_from_yaw([x_m, 0, 0], 0), (4.0, 2.0, 1.5), velocity)

    entries = () if entry_x_m is None else (other(entry_x_m),)
    others = () if truth_x_m is None else (radio(2, truth_x_m, 5.0),)
    return Moment(nth * 100_000_000, radio(1, 0.0, 15.0), entries, others, frozenset({1, 2}))


def test_false_alarms_and_misses() -> None:
    """A ghost for 0.3 s, 3 s later a true danger that the map shows, 3 s later one that it does not."""
    drive = [moment(nth, None, None) for nth in range(90)]
    for nth in (0, 1, 2):
        drive[nth] = moment(nth, 20.0, 60.0)
    for nth in (32, 33):
        drive[nth] = moment(nth, 20.0, 20.0)
    for nth in (64, 65, 66, 67):
        drive[nth] = moment(nth, None, 20.0)
    found = warnings(drive)
    assert (found.alarms, found.dangers, found.false_alarms, found.misses) == (2, 2, 1, 1)
    assert found.alarm_s == pytest.approx(0.5)
    assert found.danger_s == pytest.approx(0.6)
    assert found.false_alarm_s == pytest.approx(0.3)


def test_a_vehicle_that_takes_itself_for_elsewhere() -> None:
    """Its estimate is 60 m too far ahead: what is before it seems to be behind."""
    drive = [moment(nth, 20.0, 20.0) for nth in range(3)]
    assert warnings(drive).misses == 0
    assert warnings(drive, [OWN._replace(x_m=60.0)] * 3).misses == 1
