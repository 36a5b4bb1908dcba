"""Honest claims whose numbers are known: a car at 10 m/s along +x, a CAM every 0.4 s."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle

START_NS = 1_767_268_800_000_000_000
EGO = ReceivingVehicle(station_id=1, x_m=-100.0, y_m=20.0, yaw_rad=0.0, length_m=4.5, width_m=1.8)

Make = Callable[..., Claim]


def claim(time_s: float = 0.0, station_id: int = 7, **values: float) -> Claim:
    """One message, 50 ms old on arrival."""
    generation_ns = START_NS + round(time_s * 1e9)
    honest = Claim(
        station_id=station_id,
        arrival_ns=generation_ns + 50_000_000,
        generation_ns=generation_ns,
        x_m=10.0 * time_s,
        y_m=0.0,
        yaw_rad=0.0,
        speed_mps=10.0,
        acceleration_mps2=0.0,
        yaw_rate_radps=0.0,
        length_m=4.0,
        width_m=2.0,
        position_m=1.0,
        speed_confidence_mps=0.2,
        heading_confidence_rad=0.02,
        station_type=5,
    )
    return honest._replace(**values)  # type: ignore[arg-type]


@pytest.fixture
def make() -> Make:
    return claim


@pytest.fixture
def ego() -> ReceivingVehicle:
    return EGO
