from __future__ import annotations

import pytest
from v2x_lane import SPEED_MPS, context, edited, lane, radio

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.v2x.drop import Drop

DRIVE = lane({1: 0.0, 2: 50.0}, 20)


def kept(attack, drive, station=1):
    return [one.number // 1000 for one in edited(attack, drive) if one.station_id == station]


def test_only_the_attackers_messages_are_dropped():
    attack = Drop(context("cam-drop"))
    assert kept(attack, DRIVE) == []
    assert kept(Drop(context("cam-drop")), DRIVE, station=2) == list(range(20))


def test_a_share_is_dropped():
    """Of 2000 messages, each kept with 0.3: 600 on average, 20.5 the standard deviation."""
    counts = len(kept(Drop(context("cam-drop"), probability=0.7), lane({1: 0.0}, 2000)))
    assert 600 - 4 * 20.5 < counts < 600 + 4 * 20.5


def test_messages_are_dropped_near_the_victim_only():
    """The victim stands at 100 m: it is within 85.5 m when the attacker, at 10 m/s, has come 14.5 m."""
    drive = [step._replace(radios=(step.radios[0], radio(2, 100.0, speed_mps=0.0))) for step in DRIVE]
    assert kept(Drop(context("cam-drop", victim=2), near_m=85.5), drive) == list(range(15))
    assert SPEED_MPS * 1.4 < 14.5 < SPEED_MPS * 1.5


def test_only_braking_messages_are_dropped():
    drive = lane({1: 0.0, 2: 50.0}, 20, accelerations_mps2={1: -4.0, 2: -1.0})
    context_of_both = context("cam-drop", attackers=(1, 2))
    attack = Drop(context_of_both, braking_mps2=3.0)
    after = edited(attack, drive)
    assert {one.station_id for one in after} == {2}
    assert len(after) == 20


def test_a_distance_without_a_victim_is_refused():
    with pytest.raises(AdvpipeError, match="near_m is a distance to the victim; name one"):
        Drop(context("cam-drop"), near_m=50.0)
