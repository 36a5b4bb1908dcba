from __future__ import annotations

import pytest
from one_attacker import honest

from advpipe.pipeline.v2x.codec.codes import AccelerationControl


def drive():
    """North by 0.0001 degrees each half second."""
    return [honest(500 * k, latitude_deg=48 + k * 1e-4, speed_mps=20.0) for k in range(5)]


def test_eventual_stop_claims_standstill(strike):
    """Not at the first message, with certainty at the second: there it stands."""
    told = strike("cam-eventual-stop", drive(), probability=0.0, growth=1.0)
    assert [cam.latitude_deg for cam in told] == pytest.approx([48, *[48.0001] * 4], abs=1e-9)
    assert [cam.speed_mps for cam in told] == [20, 0, 0, 0, 0]
    assert [cam.longitudinal_acceleration_mps2 for cam in told] == [1, 0, 0, 0, 0]


def test_probability_zero_never_stops(strike):
    honest_speeds = [20.0] * 5
    told = strike("cam-eventual-stop", drive(), probability=0.0, growth=0.0)
    assert [cam.speed_mps for cam in told] == honest_speeds


def test_the_stop_probability_is_respected(strike):
    """Half of all stop at their first message."""
    stopped = [
        strike("cam-eventual-stop", drive()[:1], probability=0.5, seed=seed)[0].speed_mps == 0
        for seed in range(60)
    ]
    assert 18 <= sum(stopped) <= 42  # 3.1 standard deviations


def test_sudden_stop_claims_emergency_braking_first(strike):
    """The message of the stop brakes as in an emergency; after it, all is still."""
    told = strike("cam-sudden-stop", drive(), from_ms=1000, probability=1.0)
    assert [cam.speed_mps for cam in told] == [20, 20, 0, 0, 0]
    assert [cam.longitudinal_acceleration_mps2 for cam in told] == [1, 1, -8, 0, 0]
    assert [cam.latitude_deg for cam in told[2:]] == pytest.approx([48.0002] * 3, abs=1e-9)
    pedals = told[2].acceleration_control
    assert pedals == AccelerationControl.BRAKE_PEDAL | AccelerationControl.EMERGENCY_BRAKE
    assert told[3].acceleration_control == AccelerationControl.GAS_PEDAL


def test_the_path_history_leads_to_the_claimed_stop(strike):
    """Standing at 48.0002 since 1 s, it has passed 48.0001 at 0.5 s or 48 at 0 s on a straight line."""
    last = strike("cam-sudden-stop", drive(), from_ms=1000, probability=1.0)[-1]
    history = last.low_frequency.path_history
    total_deg = sum(point.delta_latitude_deg for point in history)
    assert total_deg == pytest.approx(-2e-4, abs=2e-7)
    assert sum(point.delta_time_s for point in history) == pytest.approx(2.0)
