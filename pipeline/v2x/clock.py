"""The clocks of stations, which may disagree with each other."""

from __future__ import annotations

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.section import V2x


def clock_error_ns(v2x: V2x, seed: int, station_id: int) -> int:
    """By how much the clock of the station with this radio is fast, all the time."""
    if not v2x.clock_error_s:
        return 0
    rng = named_generator(seed, "v2x", "clock error", station_id)
    return round(float(rng.normal(0, v2x.clock_error_s)) * 1e9)
