"""Channel access by hand: AIFS 110 us, slots of 13 us, messages of 208 us."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.access import Access
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.section import Radio

AIR_US, AIFS_US, SLOT_US = 208, 110, 13
EVERYBODY = (0, 1, 2)


def frame(sender: int, request_us: float, slots: int, heard_by: tuple[int, ...] = EVERYBODY) -> RadioFrame:
    hearing = np.isin(np.arange(3), (sender, *heard_by))
    level = np.zeros(3)
    request_ns, air_ns = round(request_us * 1000), AIR_US * 1000
    return RadioFrame(0, 0, sender, sender, request_ns, air_ns, 1000, slots, level, level, hearing)


def starts_us(
    *frames: RadioFrame, queue_delay_max_us: float = 1e6, cuts_us: tuple[float, ...] = ()
) -> list[float]:
    """When each is sent, -0.001 for those dropped."""
    access = Access(Ofdm(Radio()), round(queue_delay_max_us * 1000))
    access.rearrange(np.full(3, -1))
    begin_us = 0.0
    for end_us in (*cuts_us, 1e6):
        now = [one for one in frames if begin_us <= one.request_ns / 1000 < end_us]
        access.run(now, round(end_us * 1000))
        begin_us = end_us
    return [one.start_ns / 1000 for one in frames]


def test_a_free_channel_is_used_immediately() -> None:
    assert starts_us(frame(0, 100, 7), frame(1, 1000, 7)) == [100, 1000]


def test_a_station_waits_for_a_busy_channel() -> None:
    after = 100 + AIR_US + AIFS_US
    assert starts_us(frame(0, 100, 7), frame(1, 150, 3)) == [100, after + 3 * SLOT_US]
    assert starts_us(frame(0, 100, 7), frame(1, 100 + AIR_US + 50, 3)) == [100, after + 3 * SLOT_US]
    assert starts_us(frame(0, 100, 7), frame(1, after, 3)) == [100, after]


def test_the_countdown_stops_while_another_station_sends() -> None:
    after = 100 + AIR_US + AIFS_US
    first = after + 2 * SLOT_US
    left = 9 - 2
    expected = [100, first, first + AIR_US + AIFS_US + left * SLOT_US]
    assert starts_us(frame(0, 100, 0), frame(1, 150, 2), frame(2, 160, 9)) == expected


def test_equal_backoff_slots_collide() -> None:
    _, one, other = starts_us(frame(0, 100, 0), frame(1, 150, 4), frame(2, 160, 4))
    assert one == other


def test_a_station_that_senses_nothing_does_not_wait() -> None:
    assert starts_us(frame(0, 100, 0, heard_by=(2,)), frame(1, 150, 4)) == [100, 150]


def test_a_station_sends_its_messages_in_sequence() -> None:
    assert starts_us(frame(0, 100, 0), frame(0, 101, 2), frame(0, 102, 1)) == [
        100,
        100 + AIR_US + AIFS_US + 2 * SLOT_US,
        100 + 2 * (AIR_US + AIFS_US) + 3 * SLOT_US,
    ]


def test_messages_that_wait_too_long_are_dropped() -> None:
    frames = frame(0, 100, 0), frame(1, 101, 15), frame(2, 102, 0)
    start = starts_us(*frames, queue_delay_max_us=500)
    assert start == [100, pytest.approx(-0.001), 100 + AIR_US + AIFS_US]


def test_the_division_into_steps_changes_nothing() -> None:
    rng = np.random.default_rng(1)
    requests_us = np.sort(rng.uniform(0, 20_000, 60)).round(3)
    senders, slots = rng.integers(0, 3, 60), rng.integers(0, 16, 60)

    def frames() -> list[RadioFrame]:
        return [frame(*values) for values in zip(senders.tolist(), requests_us, slots.tolist(), strict=True)]

    whole = starts_us(*frames())
    assert starts_us(*frames(), cuts_us=(500, 777, 5000, 5100, 12_345, 19_999)) == whole
    assert max(np.array(whole) - requests_us) > 1000
