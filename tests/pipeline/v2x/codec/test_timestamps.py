from datetime import datetime, timedelta, timezone

import pytest

from advpipe.pipeline.v2x.codec.timestamps import (
    generation_delta_time_ms,
    generation_time_ns,
    timestamp_its_ms,
    unix_ns,
)

MS = 1_000_000


def utc_ns(*date: int) -> int:
    since = datetime(*date, tzinfo=timezone.utc) - datetime(1970, 1, 1, tzinfo=timezone.utc)
    return since // timedelta(microseconds=1) * 1000


@pytest.mark.parametrize(
    ("date", "expected_ms"),
    [
        ((2004, 1, 1), 0),
        ((2005, 12, 31, 23, 59, 59), 63_158_399_000),
        ((2006, 1, 1), 63_158_401_000),  # a leap second lies between
        ((2007, 1, 1), 94_694_401_000),  # the example of TS 102 894-2
        ((2016, 12, 31, 23, 59, 59), 410_313_603_000),
        ((2017, 1, 1), 410_313_605_000),
        ((2026, 1, 1), 694_310_405_000),
    ],
)
def test_timestamp_its_counts_leap_seconds(date: tuple[int, ...], expected_ms: int) -> None:
    assert timestamp_its_ms(utc_ns(*date)) == expected_ms
    assert unix_ns(expected_ms) == utc_ns(*date)


def test_generation_delta_time_is_modulo_65536() -> None:
    assert generation_delta_time_ms(utc_ns(2026, 1, 1)) == 904
    assert generation_delta_time_ms(utc_ns(2026, 1, 1) + 999_999) == 904
    assert generation_delta_time_ms(utc_ns(2026, 1, 1) + (65536 + 3) * MS) == 907


@pytest.mark.parametrize("age_ms", [-32_767, -1, 0, 1, 100, 32_767, 32_768])
def test_the_nearest_matching_time_is_chosen(age_ms: int) -> None:
    generated_ns = utc_ns(2026, 1, 1, 12)
    received_ns = generated_ns + age_ms * MS
    assert generation_time_ns(generation_delta_time_ms(generated_ns), received_ns) == generated_ns


def test_a_message_of_a_whole_cycle_ago_looks_fresh() -> None:
    generated_ns = utc_ns(2026, 1, 1, 12)
    received_ns = generated_ns + (65_536 + 20) * MS
    assert generation_time_ns(generation_delta_time_ms(generated_ns), received_ns) == received_ns - 20 * MS
