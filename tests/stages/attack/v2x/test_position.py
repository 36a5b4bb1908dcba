"""Metres to degrees at 48 degrees north by the series in the literature: 111190.32 m and 74625.36 m."""

from __future__ import annotations

import numpy as np
import pytest
from one_attacker import honest

from advpipe.pipeline.core.errors import AdvpipeError

NORTH_M, EAST_M = 111_190.32, 74_625.36


def offsets_m(cams):
    return np.array([((c.longitude_deg - 11) * EAST_M, (c.latitude_deg - 48) * NORTH_M) for c in cams])


def test_constant(strike):
    """Always 100 m east and 50 m north of the map's origin, however the vehicle moves."""
    messages = [honest(0), honest(500, latitude_deg=48.001), honest(1500, longitude_deg=11.002)]
    told = strike("cam-position-constant", messages, x_m=100.0, y_m=50.0)
    np.testing.assert_allclose(offsets_m(told), [[100, 50]] * 3, atol=0.02)
    assert [cam.speed_mps for cam in told] == [10.0] * 3


def test_a_constant_position_is_drawn_among_the_radios(strike):
    """Both radios stand at the origin: 100 m to each side of it."""
    told = offsets_m(strike("cam-position-constant", [honest(0), honest(1500, latitude_deg=48.01)]))
    np.testing.assert_array_equal(told[0], told[1])
    assert np.abs(told).max() <= 100.02
    assert np.abs(told).max() > 1


def test_offset(strike):
    """VeReMi's: 250 m east, 150 m south of each true place."""
    messages = [honest(0), honest(400, longitude_deg=11.001)]
    told = offsets_m(strike("cam-position-offset", messages, x_m=250.0, y_m=-150.0))
    np.testing.assert_allclose(told, [[250, -150], [250 + 74.62536, -150]], atol=0.02)


def test_drawn_offsets_have_both_signs_and_are_constant(strike):
    signs = set()
    for seed in range(12):
        told = offsets_m(strike("cam-position-offset", [honest(0), honest(1200)], seed=seed))
        np.testing.assert_array_equal(told[0], told[1])
        assert (np.abs(told) > 19.97).all()
        assert (np.abs(told) < 70.03).all()
        signs.add(tuple(np.sign(told[0])))
    assert len(signs) == 4


def test_random_positions_fill_the_rectangle(strike):
    corners = {"x_min_m": 1000.0, "x_max_m": 1400.0, "y_min_m": -200.0, "y_max_m": 0.0}
    told = offsets_m(strike("cam-position-random", [honest(ms) for ms in range(0, 2000, 100)], **corners))
    assert len(np.unique(told[:, 0])) == 20
    # A kilometre off the origin, the series for the origin's own latitude is wrong by some centimetres.
    assert (told.min(axis=0) > [999.9, -200.1]).all()
    assert (told.max(axis=0) < [1400.1, 0.1]).all()
    assert (np.ptp(told, axis=0) > [250, 120]).all()


def test_random_offsets(strike):
    told = offsets_m(
        strike("cam-position-random-offset", [honest(ms) for ms in range(0, 3000, 100)], min_m=5, max_m=6)
    )
    assert (np.abs(told) > 4.97).all()
    assert (np.abs(told) < 6.03).all()
    assert len(np.unique(told, axis=0)) == 30
    assert {tuple(row) for row in np.sign(told)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


def test_mirrored(strike):
    """Heading east, the opposite lane is to the north; heading north, to the west."""
    told = offsets_m(strike("cam-position-mirrored", [honest(0), honest(100, heading_rad=0.0)], left_m=3.5))
    np.testing.assert_allclose(told, [[0, 3.5], [-3.5, 0]], atol=0.02)


def test_the_path_history_contains_the_claimed_positions(strike):
    """Honest at the origin; a second later it claims to be 100 m east of it, having come from there."""
    messages = [honest(0), honest(1000)]
    honest_cam, lie = strike("cam-position-constant", messages, from_ms=500, x_m=100.0, y_m=0.0)
    assert honest_cam.low_frequency.path_history == ()
    (point,) = lie.low_frequency.path_history
    assert point.delta_longitude_deg * EAST_M == pytest.approx(-100, abs=0.02)
    assert point.delta_latitude_deg * NORTH_M == pytest.approx(0, abs=0.02)
    assert point.delta_time_s == 1.0
    kept = strike("cam-position-constant", messages, from_ms=500, x_m=100.0, y_m=0.0, rebuild_path=False)
    assert kept[1].low_frequency.path_history == ()


def test_same_seed_same_messages(strike):
    messages = [honest(ms) for ms in range(0, 1000, 100)]
    told = [strike("cam-position-random-offset", messages, seed=seed) for seed in (3, 3, 4)]
    assert told[0] == told[1] != told[2]


@pytest.mark.parametrize(
    ("word", "parameters"),
    [
        ("cam-position-constant", {"x_m": 1.0}),
        ("cam-position-constant", {"x_m": float("nan"), "y_m": 0.0}),
        ("cam-position-offset", {"min_m": 5.0, "max_m": 4.0}),
        ("cam-position-random", {"x_min_m": 0.0}),
        ("cam-position-random", {"x_min_m": 1.0, "x_max_m": 0.0, "y_min_m": 0.0, "y_max_m": 1.0}),
    ],
)
def test_bad_parameters(strike, word, parameters):
    with pytest.raises(AdvpipeError, match=word):
        strike(word, [honest(0)], **parameters)
