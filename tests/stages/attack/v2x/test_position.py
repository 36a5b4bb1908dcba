"""Metres to degrees at 48 degrees north by the series in the literature: 111190.32 m and 74625.36 m."""

from __future__ import annotations

import numpy as np
import pytest
from one_attacker import genuine

from advpipe.pipeline.core.errors import AdvpipeError

NORTH_M, EAST_M = 111_190.32, 74_625.36


def offsets_m(cams):
    return np.array([((c.longitude_deg - 11) * EAST_M, (c.latitude_deg - 48) * NORTH_M) for c in cams])


def test_constant(attacked_cams):
    """Always 100 m east and 50 m north of the map's origin, however the vehicle moves."""
    messages = [genuine(0), genuine(500, latitude_deg=48.001), genuine(1500, longitude_deg=11.002)]
    reported = attacked_cams("cam-position-constant", messages, x_m=100.0, y_m=50.0)
    np.testing.assert_allclose(offsets_m(reported), [[100, 50]] * 3, atol=0.02)
    assert [cam.speed_mps for cam in reported] == [10.0] * 3


def test_a_constant_position_is_drawn_among_the_radios(attacked_cams):
    """Both radios stand at the origin: 100 m to each side of it."""
    reported = offsets_m(
        attacked_cams("cam-position-constant", [genuine(0), genuine(1500, latitude_deg=48.01)])
    )
    np.testing.assert_array_equal(reported[0], reported[1])
    assert np.abs(reported).max() <= 100.02
    assert np.abs(reported).max() > 1


def test_offset(attacked_cams):
    """VeReMi's: 250 m east, 150 m south of each true place."""
    messages = [genuine(0), genuine(400, longitude_deg=11.001)]
    reported = offsets_m(attacked_cams("cam-position-offset", messages, x_m=250.0, y_m=-150.0))
    np.testing.assert_allclose(reported, [[250, -150], [250 + 74.62536, -150]], atol=0.02)


def test_drawn_offsets_have_both_signs_and_are_constant(attacked_cams):
    signs = set()
    for seed in range(12):
        reported = offsets_m(attacked_cams("cam-position-offset", [genuine(0), genuine(1200)], seed=seed))
        np.testing.assert_array_equal(reported[0], reported[1])
        assert (np.abs(reported) > 19.97).all()
        assert (np.abs(reported) < 70.03).all()
        signs.add(tuple(np.sign(reported[0])))
    assert len(signs) == 4


def test_random_positions_fill_the_rectangle(attacked_cams):
    corners = {"x_min_m": 1000.0, "x_max_m": 1400.0, "y_min_m": -200.0, "y_max_m": 0.0}
    reported = offsets_m(
        attacked_cams("cam-position-random", [genuine(ms) for ms in range(0, 2000, 100)], **corners)
    )
    assert len(np.unique(reported[:, 0])) == 20
    # A kilometre off the origin, the series for the origin's own latitude is wrong by some centimetres.
    assert (reported.min(axis=0) > [999.9, -200.1]).all()
    assert (reported.max(axis=0) < [1400.1, 0.1]).all()
    assert (np.ptp(reported, axis=0) > [250, 120]).all()


def test_random_offsets(attacked_cams):
    reported = offsets_m(
        attacked_cams(
            "cam-position-random-offset", [genuine(ms) for ms in range(0, 3000, 100)], min_m=5, max_m=6
        )
    )
    assert (np.abs(reported) > 4.97).all()
    assert (np.abs(reported) < 6.03).all()
    assert len(np.unique(reported, axis=0)) == 30
    assert {tuple(row) for row in np.sign(reported)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


def test_mirrored(attacked_cams):
    """Heading east, the opposite lane is to the north; heading north, to the west."""
    reported = offsets_m(
        attacked_cams("cam-position-mirrored", [genuine(0), genuine(100, heading_rad=0.0)], left_m=3.5)
    )
    np.testing.assert_allclose(reported, [[0, 3.5], [-3.5, 0]], atol=0.02)


def test_the_path_history_contains_the_claimed_positions(attacked_cams):
    """Honest at the origin; a second later it claims to be 100 m east of it, having come from there."""
    messages = [genuine(0), genuine(1000)]
    genuine_cam, false_cam = attacked_cams("cam-position-constant", messages, from_ms=500, x_m=100.0, y_m=0.0)
    assert genuine_cam.low_frequency.path_history == ()
    (point,) = false_cam.low_frequency.path_history
    assert point.delta_longitude_deg * EAST_M == pytest.approx(-100, abs=0.02)
    assert point.delta_latitude_deg * NORTH_M == pytest.approx(0, abs=0.02)
    assert point.delta_time_s == 1.0
    kept = attacked_cams(
        "cam-position-constant", messages, from_ms=500, x_m=100.0, y_m=0.0, rebuild_path=False
    )
    assert kept[1].low_frequency.path_history == ()


def test_same_seed_same_messages(attacked_cams):
    messages = [genuine(ms) for ms in range(0, 1000, 100)]
    reported = [attacked_cams("cam-position-random-offset", messages, seed=seed) for seed in (3, 3, 4)]
    assert reported[0] == reported[1] != reported[2]


@pytest.mark.parametrize(
    ("attack", "parameters"),
    [
        ("cam-position-constant", {"x_m": 1.0}),
        ("cam-position-constant", {"x_m": float("nan"), "y_m": 0.0}),
        ("cam-position-offset", {"min_m": 5.0, "max_m": 4.0}),
        ("cam-position-random", {"x_min_m": 0.0}),
        ("cam-position-random", {"x_min_m": 1.0, "x_max_m": 0.0, "y_min_m": 0.0, "y_max_m": 1.0}),
    ],
)
def test_bad_parameters(attacked_cams, attack, parameters):
    with pytest.raises(AdvpipeError, match=attack):
        attacked_cams(attack, [genuine(0)], **parameters)
