"""Tracks of vehicles that a LiDAR has seen, by numbers that a person can check."""

from __future__ import annotations

import pytest

from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.stages.investigate.seen_vehicles import CONFIRMED, SeenVehicles

STEP_NS = 100_000_000


def claim(time_ns: int, x_m: float) -> Claim:
    """A car at 10 m/s along x."""
    return Claim(
        7, time_ns, time_ns, x_m=x_m, y_m=0.0, yaw_rad=0.0, speed_mps=10.0, length_m=4.5, width_m=1.8
    )


def seen(clouds: int) -> SeenVehicles:
    """Seen in so many clouds, the last one at `clouds - 1` steps and as many metres."""
    vehicles = SeenVehicles()
    for step in range(clouds):
        vehicles.see(7, claim(step * STEP_NS, float(step)), step * STEP_NS)
    return vehicles


def test_a_track_leads_on_at_its_speed() -> None:
    boxes = seen(CONFIRMED).expected((CONFIRMED + 4) * STEP_NS)
    assert boxes[7][0] == pytest.approx(CONFIRMED + 4)


def test_few_clouds_make_no_track_and_a_track_is_forgotten() -> None:
    assert seen(CONFIRMED - 1).expected(CONFIRMED * STEP_NS) == {}
    assert seen(CONFIRMED).expected((CONFIRMED + 10) * STEP_NS) == {}


def test_who_claims_to_be_elsewhere_has_left_its_track() -> None:
    later_ns = CONFIRMED * STEP_NS
    assert seen(CONFIRMED).is_on_track(7, claim(later_ns, CONFIRMED + 1.5), later_ns)
    assert not seen(CONFIRMED).is_on_track(7, claim(later_ns, CONFIRMED + 2.5), later_ns)
    assert not seen(CONFIRMED).is_on_track(8, claim(later_ns, float(CONFIRMED)), later_ns)


def test_a_vehicle_that_vanished_stays_on_its_track_for_five_seconds() -> None:
    vehicles = seen(CONFIRMED)
    on_track = [
        vehicles.is_on_track(7, claim(step * STEP_NS, float(step)), step * STEP_NS)
        for step in range(CONFIRMED, CONFIRMED + 60)
    ]
    assert on_track.index(False) == 50
