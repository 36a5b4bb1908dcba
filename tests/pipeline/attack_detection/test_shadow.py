"""The shadow of a box, and the weights of the returns in it, worked out by hand."""

import numpy as np
import pytest

from advpipe.pipeline.attack_detection.shadow import PolarPoints, Shadow, ShadowReturns

CAR = np.array([10.0, 0.0, -1.25, 4.0, 2.0, 1.5, 0.0])
"""On the ground 2 m below the sensor, from x = 8 to 12 m; its top is 0.5 m below the sensor."""

FIRST_M = float(np.hypot(12, 1))
SIDE_RAD = np.arctan2(1, 8)


def at(flat_m, azimuth_rad, height_m=-1.9):
    return PolarPoints.of(
        np.array([[flat_m * np.cos(azimuth_rad), flat_m * np.sin(azimuth_rad), height_m]], float)
    )


def score(*place):
    return Shadow.of(CAR, -2.0).returns(at(*place)).score


def test_where_a_shadow_ends():
    """The ray over the top, 0.5 m down at 12.04 m, has fallen to 2 m four times as far."""
    shadow = Shadow.of(CAR, -2.0)
    assert shadow.first_m == pytest.approx(FIRST_M)
    assert shadow.length_m == pytest.approx(3 * FIRST_M)
    assert (shadow.azimuth_rad, shadow.half_rad) == pytest.approx((0, SIDE_RAD))


def test_a_box_higher_than_the_sensor_casts_the_longest_shadow():
    assert Shadow.of(CAR + [0, 0, 1, 0, 0, 0, 0], -2.0).length_m == 40


def test_weight_of_a_return():
    assert score(FIRST_M + 1e-9, 0.0) == pytest.approx(1)  # at the beginning, in the middle
    assert score(FIRST_M + 0.2 * 3 * FIRST_M, 0.0) == pytest.approx(0.5, abs=0.001)
    assert score(FIRST_M + 0.2 * 3 * FIRST_M, 0.2 * SIDE_RAD) == pytest.approx(0.25, abs=0.001)
    assert score(4 * FIRST_M + 0.1, 0.0) == 0  # beyond its end
    assert score(FIRST_M + 0.1, 1.01 * SIDE_RAD) == 0  # beside it
    assert score(FIRST_M + 0.1, 0.0, -0.4) == 0  # above the ray over the top


def test_the_score_is_the_mean_weight():
    """Weights 1 and 1/4; the least is 1/1024."""
    found = ShadowReturns(np.zeros((2, 3)), np.array([0.0, 0.2]), np.array([0.0, 0.2]))
    assert found.score == pytest.approx((0.625 - 1 / 1024) / (1 - 1 / 1024))
    assert found.and_others(found).score == found.score


def test_a_shadow_straight_behind_has_no_seam():
    behind = CAR * [-1, 1, 1, 1, 1, 1, 1]
    found = Shadow.of(behind, -2.0).returns(PolarPoints.of(np.array([[-13.0, 0.0, -1.9], [-13, -0.1, -1.9]])))
    assert found.across == pytest.approx([0, 0.1 / 13 / SIDE_RAD], abs=0.001)


def test_injected_returns_lie_in_the_shadow_and_make_it_anomalous():
    shadow = Shadow.of(CAR, -2.0)
    injected = shadow.injected(-2.0)
    assert len(injected.points) == 200
    assert injected.along.max() <= 0.2
    assert injected.across.max() <= 0.5
    assert (injected.points[:, 2] >= -2).all()
    assert injected.score > 0.2
    assert np.isfinite(shadow.injected(-np.inf).points).all()
