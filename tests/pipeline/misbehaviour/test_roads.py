"""Lanes by hand, and of a shipped network."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.roads import NO_ROADS, RoadMap, lanes


def test_off_the_road_and_the_wrong_way() -> None:
    """Two lanes 4 m apart, 3 m wide, the upper one eastbound and the lower one westbound."""
    roads = lanes([([(0, 0), (100, 0)], 3.0), ([(100, -4, 7), (50, -4, 7), (50, -4, 9), (0, -4, 7)], 3.0)])
    places = [
        (50.0, 1.0, 0.0),  # on the eastbound lane
        (50.0, 6.5, 0.0),  # 5 m off
        (50.0, 1.0, math.pi),  # against it; 3.5 m from the edge of the other
        (50.0, -4.0, math.pi),  # along the westbound lane
        (110.0, 0.0, 0.1),  # beyond the end by 10 m, 8.5 m from the edge
        (math.nan, 0.0, 0.0),
    ]
    off_m, wrong_rad = roads.measure(places)
    np.testing.assert_allclose(off_m, [0, 5.0, 0, 0, 8.5, math.nan], atol=1e-9)
    np.testing.assert_allclose(wrong_rad, [0, math.nan, math.pi, 0, math.nan, math.nan], atol=1e-9)


def test_a_wider_lane_farther_off_is_nearer() -> None:
    roads = RoadMap(np.array([[[0, 0], [10, 0.0]], [[0, 10], [10, 10.0]]]), np.array([1.0, 8.0]))
    off_m, _ = roads.measure([(5.0, 4.5, 0.0)])
    assert off_m[0] == pytest.approx(1.5)  # 5.5 to the middle of the wide one; 4 to the edge of the other


def test_without_roads_nothing_is_said() -> None:
    for nothing in (NO_ROADS, lanes([])):
        off_m, wrong_rad = nothing.measure([(0.0, 0.0, 0.0)])
        assert np.isnan([off_m[0], wrong_rad[0]]).all()
