"""TimestampIts: milliseconds of atomic time since 2004-01-01 00:00 UTC (ETSI TS 102 894-2).

Bags count nanoseconds since 1970 in UTC, which pauses for every leap second; TimestampIts does not.
"""

from __future__ import annotations

from bisect import bisect_right

NS_PER_MS = 1_000_000
GENERATION_DELTA_TIME_CYCLE_MS = 65536

_EPOCH_UNIX_S = 1_072_915_200  # 2004-01-01 00:00 UTC
_LEAP_SECONDS_UNIX_S = (1_136_073_600, 1_230_768_000, 1_341_100_800, 1_435_708_800, 1_483_228_800)
"""First UTC second after each leap second since 2004 (IERS Bulletin C): 2006, 2009, 2012, 2015, 2017."""


_LEAP_SECONDS_COUNTED_S = tuple(second + nth for nth, second in enumerate(_LEAP_SECONDS_UNIX_S, start=1))
"""The same in a count that does not pause for them."""


def timestamp_its_ms(unix_ns: int) -> int:
    """TimestampIts of a UTC time in nanoseconds since 1970, rounded down to the millisecond."""
    leap_s = bisect_right(_LEAP_SECONDS_UNIX_S, unix_ns // 1_000_000_000)
    return unix_ns // NS_PER_MS - (_EPOCH_UNIX_S - leap_s) * 1000


def unix_ns(timestamp_its_ms: int) -> int:
    """UTC in nanoseconds since 1970; a leap second itself counts as the second after it."""
    seconds = timestamp_its_ms // 1000 + _EPOCH_UNIX_S
    leap_s = bisect_right(_LEAP_SECONDS_COUNTED_S, seconds)
    return (timestamp_its_ms + (_EPOCH_UNIX_S - leap_s) * 1000) * NS_PER_MS


def generation_delta_time_ms(unix_ns: int) -> int:
    """The DE generationDeltaTime, 0..65535: TimestampIts modulo 65536 (EN 302 637-2, annex B)."""
    return timestamp_its_ms(unix_ns) % GENERATION_DELTA_TIME_CYCLE_MS


def generation_time_ns(generation_delta_time_ms: int, near_unix_ns: int) -> int:
    """The UTC time meant by a generationDeltaTime: of all that fit, the one nearest to `near_unix_ns`.

    Of two that are equally near, the past one.
    """
    near_ms = timestamp_its_ms(near_unix_ns)
    half = GENERATION_DELTA_TIME_CYCLE_MS // 2
    ahead_ms = (generation_delta_time_ms - near_ms + half) % GENERATION_DELTA_TIME_CYCLE_MS - half
    return unix_ns(near_ms + ahead_ms)
