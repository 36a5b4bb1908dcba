"""Artery's time, which begins with the warm-up, as time of the drive."""

from __future__ import annotations

from datetime import datetime, timezone

import pytest

from advpipe.pipeline.artery.records import Arrival
from advpipe.pipeline.v2x.codec.timestamps import generation_delta_time_ms
from advpipe.stages.simulate.network.artery.clock import DriveClock, artery_date

START_NS = 1_767_268_800_000_000_000


def test_the_drive_begins_with_the_step_after_begin() -> None:
    clock = DriveClock()
    assert clock.begin_step(100) == b""
    clock.finish_step(200)
    assert clock.done_ns is None
    clock.begin(START_NS)
    assert clock.begin_step(1_500_000_000) != b""
    clock.finish_step(1_600_000_000)
    assert clock.done_ns == START_NS + 100_000_000
    arrival = Arrival(1_550_000_001, 1, 2, -80.0, 9.0)
    assert clock.in_drive(arrival) == arrival._replace(time_ns=START_NS + 50_000_001)
    assert clock.begin_step(1_600_000_000) == clock.begin_step(1_700_000_000)  # of Artery's time 0


@pytest.mark.parametrize("year", [2004, 2013, 2026])
def test_artery_counts_generation_times_as_the_standard_does(year: int) -> None:
    """Artery's generationDeltaTime: milliseconds since 2004 of its date and time, without leap seconds."""
    now_ns = int(datetime(year, 6, 1, 12, 35, tzinfo=timezone.utc).timestamp()) * 10**9 + 400_000_000
    date = datetime.fromisoformat(artery_date(now_ns, now_ns - 16_600_000_000)).replace(tzinfo=timezone.utc)
    its_ms = round((date - datetime(2004, 1, 1, tzinfo=timezone.utc)).total_seconds() * 1000) + 16_600
    assert its_ms % 65536 == generation_delta_time_ms(now_ns)
