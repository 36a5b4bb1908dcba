"""LIMERIC's course by hand from TS 102 687, and the fixed point of stations that share a channel."""

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.facilities.adaptive_dcc import ALPHA, BETA, TARGET_LOAD, AdaptiveDcc
from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.section import Radio


def dcc() -> AdaptiveDcc:
    return AdaptiveDcc(Ofdm(Radio()))


def test_the_first_updates_by_hand() -> None:
    """0.0012 (0.68 - 0.2) = 0.000576 exceeds the largest rise, 0.0005; 0.984 * 0.03 + 0.0005 = 0.03002."""
    one = dcc()
    one.update(0.4)
    assert (one.load, one.share) == (0.0, 0.03)  # every second measurement counts
    one.update(0.4)
    assert (one.load, one.share) == (pytest.approx(0.2), 0.03)
    one.update(1.0)
    one.update(0.8)
    assert one.load == pytest.approx(0.55)  # 0.5 * 0.2 + 0.25 * 1.8
    assert one.share == pytest.approx(0.984 * 0.03 + 0.0012 * 0.13)


def test_a_full_channel_leads_to_the_smallest_share() -> None:
    one = dcc()
    for _ in range(1000):
        one.update(1.0)
    assert one.share == 0.0006


@pytest.mark.parametrize(("stations", "share", "load"), [(100, 0.006, 0.6), (884, 0.000758, 0.670)])
def test_stations_that_share_a_channel_approach_the_fixed_point(
    stations: int, share: float, load: float
) -> None:
    """alpha delta = beta (target - N delta): delta = 0.000816 / (0.016 + 0.0012 N), whatever the start."""
    assert share == pytest.approx(BETA * TARGET_LOAD / (ALPHA + BETA * stations), rel=2e-3)
    first, others = dcc(), dcc()
    first.share = 0.001
    for _ in range(4000):
        busy = min(1.0, first.share + (stations - 1) * others.share)
        first.update(busy)
        others.update(busy)
    assert first.share == pytest.approx(share, rel=2e-3)
    assert others.share == pytest.approx(share, rel=2e-3)
    assert others.load == pytest.approx(load, rel=2e-3)


def test_few_stations_send_at_the_largest_share() -> None:
    """Of five, the fixed point (0.0371) lies above it."""
    one = dcc()
    for _ in range(2000):
        one.update(5 * one.share)
    assert one.share == 0.03


def test_the_interval_is_the_air_time_over_the_share() -> None:
    """118 bytes of CAM and 82 of headers: 1622 bits in 34 symbols of 48, 5 before them: 39 * 8 us = 0.312 ms.

    0.312 ms / 0.0006 = 0.52 s; at a share of 0.03 it is 10.4 ms, below the least interval of 25 ms.
    """
    one = dcc()
    one.sent(118)
    assert one.interval_s == 0.025
    one.share = 0.0006
    assert one.interval_s == pytest.approx(0.52)
    one.sent(1000)
    assert one.interval_s == 1.0  # the longest


def test_loads_outside_of_a_share_of_time_are_refused() -> None:
    with pytest.raises(AdvpipeError, match="channel load"):
        dcc().update(1.5)
