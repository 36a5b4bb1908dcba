from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from shapely import LineString, Point

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.facilities.path_history import ALLOWABLE_ERROR_M, MAX_CHORD_M, PathHistory

STEP_NS = 100_000_000
GEODESY = Geodesy(48.0, 11.0, 500.0)

Places = npt.NDArray[np.float64]


def drive(path_m: Places) -> tuple[Places, list[float], PathHistory]:
    """Feed a path (N, 2) in metres, ten places a second; return the polyline of its points (K + 1, 2), latest
    first."""
    history = PathHistory()
    for step, (x, y) in enumerate(path_m):
        place = GEODESY.to_geographic([x, y, 0.01 * step])
        history.add(step * STEP_NS, *place)
    points = history.points(*place, time_ns=(len(path_m) - 1) * STEP_NS)
    polyline, times_s = [place], []
    for point in points:
        assert point.delta_latitude_deg is not None
        assert point.delta_longitude_deg is not None
        assert point.delta_altitude_m is not None
        assert point.delta_time_s is not None
        delta = [point.delta_latitude_deg, point.delta_longitude_deg, point.delta_altitude_m]
        polyline.append(polyline[-1] + delta)
        times_s.append(point.delta_time_s)
    return np.array([GEODESY.to_map(place) for place in polyline]), times_s, history


def straight(length_m: float, speed_mps: float) -> Places:
    x_m = np.arange(0, length_m, speed_mps / 10)
    return np.stack([x_m, np.zeros_like(x_m)], -1)


def winding() -> Places:
    """A town drive: bends of 15 to 60 m radius and a lane change, 12 m/s."""
    heading = np.concatenate(
        [
            np.zeros(60),
            np.linspace(0, 1.6, 20),
            np.full(40, 1.6),
            np.linspace(1.6, -1.5, 60),
            np.full(20, -1.5),
        ]
    )
    heading = np.concatenate([heading, -1.5 + 0.25 * np.sin(np.linspace(0, 2 * np.pi, 30))])
    return np.cumsum(1.2 * np.stack([np.cos(heading), np.sin(heading)], -1), axis=0)


def test_every_past_position_is_near_the_stated_line() -> None:
    path_m = winding()
    for now in range(20, len(path_m), 7):
        polyline, times_s, _ = drive(path_m[: now + 1])
        line = LineString(polyline[:, :2])
        oldest = now - round(sum(times_s) * 10)
        for x, y in path_m[oldest : now + 1]:
            assert line.distance(Point(x, y)) < ALLOWABLE_ERROR_M + 0.02
        np.testing.assert_allclose(polyline[-1, :2], path_m[oldest], atol=0.02)


def test_points_are_past_positions_at_their_times() -> None:
    path_m = winding()
    polyline, times_s, _ = drive(path_m)
    ages = np.round(np.cumsum(times_s) * 10).astype(int)
    np.testing.assert_allclose(polyline[1:, :2], path_m[len(path_m) - 1 - ages], atol=0.01)
    np.testing.assert_allclose(polyline[1:, 2], 0.01 * (len(path_m) - 1 - ages), atol=0.006)


def test_a_straight_road_takes_few_points_and_200_m() -> None:
    polyline, _, _ = drive(straight(1000, 25))
    chords_m = np.hypot(*np.diff(polyline[:, :2], axis=0).T)
    assert max(chords_m) <= MAX_CHORD_M + 2.5  # the last step may reach beyond a chord
    assert 200 <= chords_m.sum() < 200 + MAX_CHORD_M
    assert len(polyline) <= 12


def test_at_most_23_points() -> None:
    turns = np.arange(0, 40 * np.pi, 0.05)  # a roundabout of 2.5 m radius
    polyline, _, _ = drive(2.5 * np.stack([np.cos(turns), np.sin(turns)], -1))
    assert len(polyline) == 1 + 23


def test_a_standing_vehicle_adds_no_points() -> None:
    path_m = np.concatenate([straight(60, 10), np.tile([[59.0, 0.0]], (3000, 1))])
    polyline, times_s, history = drive(path_m)
    assert len(polyline) <= 5
    assert times_s[0] == pytest.approx(300, abs=5)
    place = GEODESY.to_geographic([59, 0, 0])
    (first, *_) = history.points(*place, time_ns=800 * 10**9)
    assert first.delta_time_s is None  # 655.35 s is the longest that a point can tell


def test_turning_back_keeps_the_far_end() -> None:
    there = straight(18, 5)
    polyline, _, _ = drive(np.concatenate([there, there[::-1][:20]]))
    assert polyline[:, 0].max() == pytest.approx(17.5, abs=0.02)


def test_the_history_starts_at_the_first_position() -> None:
    history = PathHistory()
    place = GEODESY.to_geographic([0, 0, 0])
    history.add(0, *place)
    assert history.points(*place, time_ns=0) == ()


def test_a_jump_ends_the_history() -> None:
    polyline, _, _ = drive(np.concatenate([straight(100, 10), straight(10, 10) + [0, 5000]]))
    assert polyline[:, 1].min() > 4900


def test_altitude_is_optional() -> None:
    history = PathHistory()
    for step in range(50):
        latitude, longitude, _ = GEODESY.to_geographic([2.0 * step, 0, 0])
        history.add(step * STEP_NS, latitude, longitude)
    (first, *_) = history.points(latitude, longitude, 3.0, 49 * STEP_NS)
    assert first.delta_altitude_m is None


def test_the_history_crosses_the_date_line() -> None:
    history = PathHistory()
    for step in range(100):
        longitude = math.remainder(179.9995 + 2e-5 * step, 360)
        history.add(step * STEP_NS, 10.0, longitude, 0.0)
    points = history.points(10.0, longitude, 0.0, 99 * STEP_NS)
    back_deg = sum(point.delta_longitude_deg or 0 for point in points)
    assert -222 / 109_640 < back_deg < -200 / 109_640  # a degree of longitude is 109.64 km there
