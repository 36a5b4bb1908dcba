"""Each check against numbers worked by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from advpipe.pipeline.misbehaviour import checks
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import Expectation

Make = Callable[..., Claim]
ROUND = Expectation(
    position_m=0.0,
    position_m_per_root_s=0.0,
    speed_mps=0.1,
    speed_mps_per_root_s=0.0,
    acceleration_change_mps2=8.0,
    heading_rad=0.01,
    heading_rad_per_root_s=0.0,
    yaw_rate_change_radps=0.0,
    overhang_m=0.0,
    turn_share=0.0,
    swing_share=0.0,
    acceleration_share=0.0,
    speed_bias_mps=0.0,
)
"""So that a standard deviation of the way is t² metres: an eighth of 8 m/s² times t²."""


def test_range(make: Make, ego: ReceivingVehicle) -> None:
    at = make(x_m=200.0, y_m=420.0)
    assert checks.claimed_range_m(at, ego) == 500.0  # 300 to the side and 400 ahead


def test_freshness(make: Make) -> None:
    assert checks.freshness_s(make()) == pytest.approx(0.05)
    future = make()._replace(generation_ns=make().arrival_ns + 2_000_000_000)
    assert checks.freshness_s(future) == 2.0


def test_frequency(make: Make) -> None:
    first = make(0.0)
    assert checks.frequency_hz(make(0.4), first) == pytest.approx(2.5)
    copy = first._replace(arrival_ns=first.arrival_ns + 200_000_000)  # generated at the same time
    assert checks.frequency_hz(copy, first) == math.inf
    hasty = make(0.4)._replace(arrival_ns=first.arrival_ns + 50_000_000)
    assert checks.frequency_hz(hasty, first) == pytest.approx(20.0)


def test_position_and_speed(make: Make) -> None:
    """10 m/s for half a second is 5 m; 7 m came out: 2 m off, which is 8 sigma of 0.25 m."""
    assert checks.position_speed_sigma(make(0.5, x_m=7.0), make(0.0), ROUND) == pytest.approx(8.0)
    assert checks.position_speed_sigma(make(0.5), make(0.0), ROUND) == pytest.approx(0.0, abs=1e-9)
    # The mean of 10 and 14 m/s.
    faster = make(0.5, x_m=6.0, speed_mps=14.0)
    assert checks.position_speed_sigma(faster, make(0.0), ROUND) == pytest.approx(0.0, abs=1e-9)


def test_what_is_not_stated_is_not_judged(make: Make) -> None:
    silent = make(0.5, speed_mps=math.nan, acceleration_mps2=math.nan, yaw_rate_radps=math.nan)
    for check in (checks.position_speed_sigma, checks.acceleration_sigma, checks.turn_sigma):
        assert math.isnan(check(silent, make(0.0), ROUND))


def test_heading(make: Make) -> None:
    """It moves along +x for 5 m and tells 0.05 rad: 5 sigma of 0.01; backwards, the way counts turned."""
    turned = make(0.5, yaw_rad=0.05)
    found = checks.heading_sigma(turned, make(0.0, yaw_rad=0.05), ROUND)
    assert found == pytest.approx(5.0)
    back = checks.heading_sigma(
        make(0.5, yaw_rad=math.pi, speed_mps=-10.0), make(0.0, yaw_rad=math.pi, speed_mps=-10.0), ROUND
    )
    assert back == pytest.approx(0.0, abs=1e-9)
    reversed_ = checks.heading_sigma(make(0.5, yaw_rad=math.pi), make(0.0, yaw_rad=math.pi), ROUND)
    assert reversed_ == pytest.approx(100 * math.pi)


def test_heading_of_what_hardly_moves_says_nothing(make: Make) -> None:
    assert math.isnan(checks.heading_sigma(make(0.05), make(0.0), ROUND))  # half a metre
    slow = make(0.5, x_m=2.0, speed_mps=0.5)
    assert math.isnan(checks.heading_sigma(slow, make(0.0), ROUND))


def test_turn(make: Make) -> None:
    """0.2 to 0.4 rad/s for half a second turn by 0.1 to 0.2 rad; 0.25 is 0.05 more: 5 sigma of 0.01."""
    before = make(0.0, yaw_rate_radps=0.2)
    assert checks.turn_sigma(make(0.5, yaw_rad=0.25, yaw_rate_radps=0.4), before, ROUND) == pytest.approx(5.0)
    assert checks.turn_sigma(make(0.5, yaw_rad=0.15, yaw_rate_radps=0.4), before, ROUND) == 0.0


def test_turn_across_the_end_of_the_circle(make: Make) -> None:
    before = make(0.0, yaw_rad=math.pi - 0.05, yaw_rate_radps=0.2)
    after = make(0.5, yaw_rad=-math.pi + 0.05, yaw_rate_radps=0.2)
    assert checks.turn_sigma(after, before, ROUND) == pytest.approx(0.0, abs=1e-9)


def test_acceleration(make: Make) -> None:
    """1 to 2 m/s² for half a second are 0.5 to 1 m/s; it slows down by 1 instead: 1.5 off.

    Sigma: 0.1 and 8 * 0.5 / 2 * 0.5 = 1, together sqrt(1.01).
    """
    before = make(0.0, acceleration_mps2=1.0)
    found = checks.acceleration_sigma(make(0.5, speed_mps=9.0, acceleration_mps2=2.0), before, ROUND)
    assert found == pytest.approx(1.5 / math.sqrt(1.01))
    fits = make(0.5, speed_mps=10.75, acceleration_mps2=2.0)
    assert checks.acceleration_sigma(fits, before, ROUND) == 0.0


def test_hard_braking_is_expected_to_change(make: Make) -> None:
    """At 6 m/s² the driver may change it by 3 within a second: 0.3 over half a second, beside the rest."""
    before = make(0.0, acceleration_mps2=-6.0)
    after = make(0.5, speed_mps=8.5, acceleration_mps2=-6.0)  # 1.5 less, where 3 are claimed
    expected = replace(ROUND, acceleration_change_mps2=0.0, acceleration_share=0.5)
    sigma = math.hypot(0.1, 0.5 * 6.0 * 0.5 * 0.5)
    assert checks.acceleration_sigma(after, before, expected) == pytest.approx(1.5 / sigma)


def test_the_centre_of_a_turning_box_swings(make: Make) -> None:
    """A bus of 12 m that turns by 0.2 rad: half of 6 m times 0.2, by headings or yaw rates."""
    expected = replace(ROUND, swing_share=0.5)
    before = make(0.0, length_m=12.0)
    assert checks.swing_m(make(0.5, length_m=12.0, yaw_rad=0.2), before, expected) == pytest.approx(0.6)
    by_rate = make(0.5, length_m=12.0, yaw_rate_radps=0.4)
    assert checks.swing_m(by_rate, before, expected) == pytest.approx(0.6)
    around = make(0.5, length_m=12.0, yaw_rad=math.pi)  # no vehicle swings by more than 1 rad
    assert checks.swing_m(around, before, expected) == pytest.approx(3.0)
    assert checks.swing_m(around._replace(length_m=math.nan), before, expected) == 0.0
    jump = make(0.5, x_m=5.6, yaw_rad=0.0, yaw_rate_radps=0.4, length_m=12.0)
    sigma = math.hypot(8.0 * 0.25 / 8, 0.6)
    assert checks.position_speed_sigma(jump, before, expected) == pytest.approx(0.6 / sigma)


def test_dynamics(make: Make) -> None:
    assert checks.dynamics_mps2(make(acceleration_mps2=-9.0), None) == 9.0
    assert checks.dynamics_mps2(make(0.5, speed_mps=20.0), make(0.0)) == pytest.approx(20.0)


def test_size(make: Make) -> None:
    assert checks.size_m(make(length_m=4.5, width_m=1.8), make()) == pytest.approx(0.5)
    assert checks.size_m(make(), make()) == 0.0


def test_appearance(make: Make, ego: ReceivingVehicle) -> None:
    """30 m from the receiver, who hears 300 m: 270 m within."""
    assert checks.appearance_m(make(x_m=-70.0, y_m=20.0), ego, 300.0) == pytest.approx(270.0)
    assert checks.appearance_m(make(x_m=900.0), ego, 300.0) == 0.0


def test_overlap(make: Make) -> None:
    """Two boxes of 4 m by 2 m, 3 m apart along: 1 m by 2 m of 8 m² is a quarter."""
    at_ns = make().generation_ns
    own, other = checks.claimed_box(make(), at_ns), checks.claimed_box(make(x_m=3.0), at_ns)
    assert own is not None
    assert other is not None
    assert checks.overlap_share(own, [other]) == pytest.approx(0.25)
    later = checks.claimed_box(make(), at_ns + 300_000_000)  # carried on by 3 m
    assert later is not None
    assert checks.overlap_share(later, [other]) == pytest.approx(1.0)
    assert checks.overlap_share(own, []) == 0.0
    assert checks.claimed_box(make(length_m=math.inf), at_ns) is None
