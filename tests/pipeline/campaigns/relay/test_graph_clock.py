"""The time of a ROS 2 graph."""

import pytest

from advpipe.pipeline.campaigns.relay.graph_clock import ClockJumpedBackError, GraphClock
from advpipe.pipeline.messages.build import clock
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import serialise

SECOND_NS = 10**9


class Times:
    def __init__(self) -> None:
        self.monotonic_ns = 0

    def graph_clock(self) -> GraphClock:
        return GraphClock(lambda: 5000 * SECOND_NS + self.monotonic_ns, lambda: self.monotonic_ns)


def tick(at_ns: int) -> bytes:
    return serialise(clock(at_ns), CLOCK.type)


def test_without_a_clock_it_is_the_systems() -> None:
    times = Times()
    found = times.graph_clock()
    assert not found.has_ticked
    assert found.now_ns() == 5000 * SECOND_NS


def test_time_goes_on_between_ticks_but_not_for_long() -> None:
    times = Times()
    found = times.graph_clock()
    found.tick(tick(70 * SECOND_NS))
    times.monotonic_ns = 20_000_000
    assert found.now_ns() == 70 * SECOND_NS + 20_000_000
    times.monotonic_ns = 9 * SECOND_NS  # a player that pauses
    assert found.now_ns() == 70 * SECOND_NS + 100_000_000
    found.tick(tick(70 * SECOND_NS + 50_000_000))
    assert found.now_ns() == 70 * SECOND_NS + 100_000_000, "never backwards"


def test_a_clock_that_jumps_back() -> None:
    found = Times().graph_clock()
    found.tick(tick(70 * SECOND_NS))
    found.now_ns()
    with pytest.raises(ClockJumpedBackError, match=r"^/clock jumped back by 8.5 s$"):
        found.tick(tick(61 * SECOND_NS + SECOND_NS // 2))


def test_bytes_that_are_no_clock() -> None:
    found = Times().graph_clock()
    found.tick(b"\0\1\0\0")
    assert not found.has_ticked
