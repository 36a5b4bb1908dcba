"""What honest stations do is excused, and the same claims without the manoeuvre are not."""

from __future__ import annotations

import math

import pytest

from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.stages.investigate.manoeuvres import (
    AFTER_NS,
    BESIDE_LANES,
    MEMORY_NS,
    OF_BRAKING,
    OF_LONG_TURNS,
    OF_SPINS,
    Manoeuvres,
)

STEP_NS = 100_000_000
TRUCK_M, CAR_M = 16.5, 4.5


def claim(step: int, **claimed: float) -> Claim:
    """A car that drives straight on at 10 m/s."""
    usual = {"speed_mps": 10.0, "acceleration_mps2": 0.0, "yaw_rate_radps": 0.0, "length_m": CAR_M}
    time_ns = 1 + step * STEP_NS
    return Claim(7, time_ns, time_ns, x_m=0.0, y_m=0.0, yaw_rad=0.0, width_m=2.0, **{**usual, **claimed})


def excused(*claims: Claim) -> frozenset[str]:
    """What excuses the last one."""
    manoeuvres = Manoeuvres()
    return [manoeuvres.excuses(each) for each in claims][-1]


@pytest.mark.parametrize(("length_m", "expected"), [(TRUCK_M, OF_LONG_TURNS), (CAR_M, frozenset())])
def test_long_bodies_have_no_heading_while_they_turn(length_m: float, expected: frozenset[str]) -> None:
    assert excused(claim(0, length_m=length_m, yaw_rate_radps=0.3)) == expected


@pytest.mark.parametrize(("beside_m", "is_excused"), [(8.0, True), (9.0, False), (math.nan, False)])
def test_a_long_body_that_turns_is_beside_the_lanes_by_half_of_its_length(
    beside_m: float, is_excused: bool
) -> None:
    found = excused(claim(0, length_m=TRUCK_M, yaw_rate_radps=0.3, off_road_m=beside_m))
    assert (found >= BESIDE_LANES) is is_excused


def test_a_turn_excuses_what_comes_shortly_after_it() -> None:
    turn = claim(0, length_m=TRUCK_M, yaw_rate_radps=-0.3)
    after = AFTER_NS // STEP_NS
    assert excused(turn, claim(after - 1, length_m=TRUCK_M)) >= OF_LONG_TURNS
    assert not excused(turn, claim(after, length_m=TRUCK_M)) & OF_LONG_TURNS
    assert not excused(claim(0, length_m=TRUCK_M), claim(1, length_m=TRUCK_M)) & OF_LONG_TURNS


@pytest.mark.parametrize(("rate_deg", "expected"), [(327.66, OF_SPINS), (327.0, frozenset())])
def test_a_yaw_rate_at_the_end_of_its_code_explains_any_turn(
    rate_deg: float, expected: frozenset[str]
) -> None:
    assert excused(claim(0, yaw_rate_radps=math.radians(rate_deg))) == expected


@pytest.mark.parametrize(
    ("mps2", "slower_mps", "is_excused"),
    [
        (-9.0, 0.9, True),  # brakes as it says
        (-9.0, 0.0, False),  # says that it brakes, and does not
        (-12.0, 1.2, False),  # harder than tyres can
        (0.0, 0.9, False),  # brakes, and does not say so
        (9.0, -0.9, False),  # no vehicle speeds up like that
    ],
)
def test_hard_braking_that_speeds_bear_out_is_no_lie(
    mps2: float, slower_mps: float, is_excused: bool
) -> None:
    found = excused(
        claim(0, acceleration_mps2=mps2), claim(1, acceleration_mps2=mps2, speed_mps=10 - slower_mps)
    )
    assert (found == OF_BRAKING) is is_excused


def test_values_that_are_not_claimed_excuse_nothing() -> None:
    nothing = dict.fromkeys(("length_m", "yaw_rate_radps", "acceleration_mps2", "speed_mps"), math.nan)
    assert excused(claim(0, **nothing), claim(1, **nothing)) == frozenset()


def test_silent_stations_are_forgotten() -> None:
    manoeuvres = Manoeuvres()
    for number in range(50):
        manoeuvres.excuses(claim(0)._replace(station_id=number))
    manoeuvres.excuses(claim(2 * MEMORY_NS // STEP_NS))
    assert len(manoeuvres._stations) == 1
