from __future__ import annotations

import pytest
from one_attacker import genuine

from advpipe.pipeline.core.errors import AdvpipeError


def speeds(cams):
    return [cam.speed_mps for cam in cams]


def test_constant(attacked_cams):
    messages = [genuine(0), genuine(500, speed_mps=3.0), genuine(900, speed_mps=0.0)]
    assert speeds(attacked_cams("cam-speed-constant", messages, speed_mps=0.0)) == [0, 0, 0]
    assert speeds(attacked_cams("cam-speed-constant", messages, from_ms=500, speed_mps=22.5)) == [
        10,
        22.5,
        22.5,
    ]
    drawn = speeds(attacked_cams("cam-speed-constant", messages))
    assert len(set(drawn)) == 1
    assert 0 <= drawn[0] <= 40


def test_offset(attacked_cams):
    """10 - 4 = 6; 3 - 4 is below zero, and becomes zero."""
    messages = [genuine(0), genuine(500, speed_mps=3.0)]
    assert speeds(attacked_cams("cam-speed-offset", messages, offset_mps=-4.0)) == [6, 0]
    assert speeds(attacked_cams("cam-speed-offset", messages, offset_mps=2.5)) == [12.5, 5.5]
    drawn = {tuple(speeds(attacked_cams("cam-speed-offset", messages, seed=seed))) for seed in range(8)}
    assert {first > 10 for first, _ in drawn} == {True, False}
    assert all(1 <= abs(first - 10) <= 7.01 for first, _ in drawn)


def test_random(attacked_cams):
    reported = speeds(
        attacked_cams("cam-speed-random", [genuine(ms) for ms in range(0, 2000, 100)], max_mps=8.0)
    )
    assert len(set(reported)) > 15
    assert max(reported) <= 8.0
    assert max(reported) - min(reported) > 4


def test_random_offset(attacked_cams):
    """Always 2 m/s away, above or below: 12 or 8."""
    messages = [genuine(ms) for ms in range(0, 2000, 100)]
    reported = speeds(attacked_cams("cam-speed-random-offset", messages, min_mps=2.0, max_mps=2.0))
    assert set(reported) == {12, 8}


def test_frozen_from_a_random_message_on(attacked_cams):
    """With certainty, at the first message in which it acts: 7 m/s for good."""
    messages = [
        genuine(0),
        genuine(400, speed_mps=7.0),
        genuine(800, speed_mps=5.0),
        genuine(1200, speed_mps=0),
    ]
    assert speeds(attacked_cams("cam-speed-frozen", messages, from_ms=400, probability=1.0)) == [10, 7, 7, 7]
    assert speeds(attacked_cams("cam-speed-frozen", messages, probability=0.0)) == [10, 7, 5, 0]


@pytest.mark.parametrize(
    ("attack", "parameters"),
    [
        ("cam-speed-constant", {"speed_mps": 200.0}),
        ("cam-speed-offset", {"min_mps": -1.0}),
        ("cam-speed-random", {"max_mps": float("inf")}),
        ("cam-speed-frozen", {"probability": 1.5}),
    ],
)
def test_bad_parameters(attacked_cams, attack, parameters):
    with pytest.raises(AdvpipeError, match=attack):
        attacked_cams(attack, [genuine(0)], **parameters)
