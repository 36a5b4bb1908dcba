"""A car with default values, of which a test states only those that it needs."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.station_state import StationState

START_NS = 1_767_268_800_000_000_000  # 2026-01-01 12:00 UTC


@pytest.fixture
def car() -> Callable[..., StationState]:
    def car(**changes: object) -> StationState:
        values: dict[str, object] = {
            "station_id": 7,
            "station_type": StationType.PASSENGER_CAR,
            "time_ns": START_NS,
            "latitude_deg": 48.0,
            "longitude_deg": 11.0,
            "heading_rad": 0.0,
            "speed_mps": 0.0,
            "length_m": 4.5,
            "width_m": 1.8,
        }
        return StationState(**(values | changes))  # type: ignore[arg-type]

    return car
