from __future__ import annotations

import pytest
from one_attacker import honest

from advpipe.pipeline.core.errors import AdvpipeError


def speeds(cams):
    return [cam.speed_mps for cam in cams]


def test_constant(strike):
    messages = [honest(0), honest(500, speed_mps=3.0), honest(900, speed_mps=0.0)]
    assert speeds(strike("cam-speed-constant", messages, speed_mps=0.0)) == [0, 0, 0]
    assert speeds(strike("cam-speed-constant", messages, from_ms=500, speed_mps=22.5)) == [10, 22.5, 22.5]
    drawn = speeds(strike("cam-speed-constant", messages))
    assert len(set(drawn)) == 1
    assert 0 <= drawn[0] <= 40


def test_offset(strike):
    """10 - 4 = 6; 3 - 4 is below zero, and told as zero."""
    messages = [honest(0), honest(500, speed_mps=3.0)]
    assert speeds(strike("cam-speed-offset", messages, offset_mps=-4.0)) == [6, 0]
    assert speeds(strike("cam-speed-offset", messages, offset_mps=2.5)) == [12.5, 5.5]
    drawn = {tuple(speeds(strike("cam-speed-offset", messages, seed=seed))) for seed in range(8)}
    assert {first > 10 for first, _ in drawn} == {True, False}
    assert all(1 <= abs(first - 10) <= 7.01 for first, _ in drawn)


def test_random(strike):
    told = speeds(strike("cam-speed-random", [honest(ms) for ms in range(0, 2000, 100)], max_mps=8.0))
    assert len(set(told)) > 15
    assert max(told) <= 8.0
    assert max(told) - min(told) > 4


def test_random_offset(strike):
    """Always 2 m/s away, above or below: 12 or 8."""
    messages = [honest(ms) for ms in range(0, 2000, 100)]
    told = speeds(strike("cam-speed-random-offset", messages, min_mps=2.0, max_mps=2.0))
    assert set(told) == {12, 8}


def test_frozen_from_a_random_message_on(strike):
    """With certainty, at the first message in which it acts: 7 m/s for good."""
    messages = [honest(0), honest(400, speed_mps=7.0), honest(800, speed_mps=5.0), honest(1200, speed_mps=0)]
    assert speeds(strike("cam-speed-frozen", messages, from_ms=400, probability=1.0)) == [10, 7, 7, 7]
    assert speeds(strike("cam-speed-frozen", messages, probability=0.0)) == [10, 7, 5, 0]


@pytest.mark.parametrize(
    ("word", "parameters"),
    [
        ("cam-speed-constant", {"speed_mps": 200.0}),
        ("cam-speed-offset", {"min_mps": -1.0}),
        ("cam-speed-random", {"max_mps": float("inf")}),
        ("cam-speed-frozen", {"probability": 1.5}),
    ],
)
def test_bad_parameters(strike, word, parameters):
    with pytest.raises(AdvpipeError, match=word):
        strike(word, [honest(0)], **parameters)
