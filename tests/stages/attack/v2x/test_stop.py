from __future__ import annotations

import pytest
from one_attacker import genuine

from advpipe.pipeline.v2x.codec.codes import AccelerationControl


def drive():
    """North by 0.0001 degrees each half second."""
    return [genuine(500 * k, latitude_deg=48 + k * 1e-4, speed_mps=20.0) for k in range(5)]


def test_eventual_stop_claims_standstill(attacked_cams):
    """Not at the first message, with certainty at the second: there it stands."""
    reported = attacked_cams("cam-eventual-stop", drive(), probability=0.0, growth=1.0)
    assert [cam.latitude_deg for cam in reported] == pytest.approx([48, *[48.0001] * 4], abs=1e-9)
    assert [cam.speed_mps for cam in reported] == [20, 0, 0, 0, 0]
    assert [cam.longitudinal_acceleration_mps2 for cam in reported] == [1, 0, 0, 0, 0]


def test_probability_zero_never_stops(attacked_cams):
    honest_speeds = [20.0] * 5
    reported = attacked_cams("cam-eventual-stop", drive(), probability=0.0, growth=0.0)
    assert [cam.speed_mps for cam in reported] == honest_speeds


def test_the_stop_probability_is_respected(attacked_cams):
    """Half of all stop at their first message."""
    stopped = [
        attacked_cams("cam-eventual-stop", drive()[:1], probability=0.5, seed=seed)[0].speed_mps == 0
        for seed in range(60)
    ]
    assert 18 <= sum(stopped) <= 42  # 3.1 standard deviations


def test_sudden_stop_claims_emergency_braking_first(attacked_cams):
    """The message of the stop brakes as in an emergency; after it, all is still."""
    reported = attacked_cams("cam-sudden-stop", drive(), from_ms=1000, probability=1.0)
    assert [cam.speed_mps for cam in reported] == [20, 20, 0, 0, 0]
    assert [cam.longitudinal_acceleration_mps2 for cam in reported] == [1, 1, -8, 0, 0]
    assert [cam.latitude_deg for cam in reported[2:]] == pytest.approx([48.0002] * 3, abs=1e-9)
    pedals = reported[2].acceleration_control
    assert pedals == AccelerationControl.BRAKE_PEDAL | AccelerationControl.EMERGENCY_BRAKE
    assert reported[3].acceleration_control == AccelerationControl.GAS_PEDAL


def test_the_path_history_leads_to_the_claimed_stop(attacked_cams):
    """Standing at 48.0002 since 1 s, it has passed 48.0001 at 0.5 s or 48 at 0 s on a straight line."""
    last = attacked_cams("cam-sudden-stop", drive(), from_ms=1000, probability=1.0)[-1]
    history = last.low_frequency.path_history
    total_deg = sum(point.delta_latitude_deg for point in history)
    assert total_deg == pytest.approx(-2e-4, abs=2e-7)
    assert sum(point.delta_time_s for point in history) == pytest.approx(2.0)
