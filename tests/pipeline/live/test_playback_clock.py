"""Recorded time against a monotonic clock."""

import pytest

from advpipe.pipeline.live.playback_clock import PlaybackClock

BEGIN_NS = 1_767_268_800_000_000_000


class Hand:
    """A clock that a test sets."""

    now_ns = 5

    def __call__(self) -> int:
        return self.now_ns


def test_a_moment_is_due_at_the_rate() -> None:
    hand = Hand()
    clock = PlaybackClock(BEGIN_NS, 2.0, hand)
    assert clock.left_s(BEGIN_NS) == 0
    assert clock.left_s(BEGIN_NS + 10**9) == pytest.approx(0.5)
    hand.now_ns += 600_000_000
    assert clock.left_s(BEGIN_NS + 10**9) == pytest.approx(-0.1)
    assert clock.time_ns() == BEGIN_NS + 1_200_000_000


def test_nothing_is_lost_by_a_pause() -> None:
    hand = Hand()
    clock = PlaybackClock(BEGIN_NS, 1.0, hand)
    hand.now_ns += 300_000_000
    clock.toggle_pause()
    assert clock.is_paused
    hand.now_ns += 10**12
    assert clock.time_ns() == BEGIN_NS + 300_000_000
    assert clock.left_s(BEGIN_NS + 10**9) == pytest.approx(0.7)
    clock.toggle_pause()
    assert not clock.is_paused
    assert clock.left_s(BEGIN_NS + 10**9) == pytest.approx(0.7)
    hand.now_ns += 100_000_000
    assert clock.time_ns() == BEGIN_NS + 400_000_000
