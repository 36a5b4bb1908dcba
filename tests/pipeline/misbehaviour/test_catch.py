"""The baseline's checks against numbers worked by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.catch import (
    CATCH_CHECKS,
    CatchParameters,
    catch_factors,
    catch_flags,
    catch_messages,
    travel_bounds_m,
)
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle

Make = Callable[..., Claim]
PARAMETERS = CatchParameters(max_speed_mps=40.0, max_range_m=320.0)


def factor(name: str, claims: Sequence[Claim], ego: ReceivingVehicle, **changes: float) -> float:
    """Of the last message."""
    parameters = CatchParameters(**{"max_speed_mps": 40.0, "max_range_m": 320.0} | changes)
    table = catch_factors(catch_messages(claims, [ego] * len(claims)), parameters)
    return float(table[-1, CATCH_CHECKS.index(name)])


def test_range(make: Make, ego: ReceivingVehicle) -> None:
    """At 320 m half of ±1 m is within; at 319.5 three quarters; at 325 nothing."""
    for x_m, share in ((220.0, 0.5), (219.5, 0.75), (225.0, 0.0), (0.0, 1.0)):
        assert factor("range", [make(x_m=x_m, y_m=20.0)], ego) == pytest.approx(share)


def test_speed(make: Make, ego: ReceivingVehicle) -> None:
    """Half of the confidence either way, as published: 40.05 ± 0.1 m/s is a quarter below 40."""
    assert factor("speed", [make(speed_mps=40.05)], ego) == pytest.approx(0.25)


def test_position(make: Make, ego: ReceivingVehicle) -> None:
    off = make(off_road_m=2.5)
    assert factor("position", [off], ego) == pytest.approx(0.25)  # 2.5 ± 1 m against 2 m
    assert factor("position", [off._replace(speed_mps=0.5)], ego) == 1.0  # parked
    assert factor("position", [make()], ego) == 1.0  # no roads known


def test_position_and_speed_consistency(make: Make, ego: ReceivingVehicle) -> None:
    jump = [make(0.0), make(0.5, x_m=20.5)]  # 20 m at 40 m/s; ± 2 m
    assert factor("position_consistency", jump, ego) == pytest.approx((20 - 20.5 + 2) / 4)
    faster = [make(0.0), make(0.5, speed_mps=11.7)]  # 1.6 m/s at 3.2 m/s²; ± 0.4
    assert factor("speed_consistency", faster, ego) == pytest.approx((1.6 - 1.7 + 0.4) / 0.8)


def test_shortest_and_longest_way() -> None:
    """From 10 to 10 m/s in 2 s at ±2 m/s²: up to 12 and down is 22 m, down to 8 and up is 18 m."""
    speeds = np.array([10.0])
    least, most = travel_bounds_m(speeds, speeds, np.array([2.0]), 2.0, 2.0)
    assert least[0] == pytest.approx(18.0)
    assert most[0] == pytest.approx(22.0)
    # From 2 to 2 m/s in 4 s it can stop in between: 1 m to brake, 1 m to get going.
    least, _ = travel_bounds_m(np.array([2.0]), np.array([2.0]), np.array([4.0]), 2.0, 2.0)
    assert least[0] == pytest.approx(2.0)


def test_way_against_speed(make: Make, ego: ReceivingVehicle) -> None:
    honest = [make(0.0), make(0.5)]
    jump = [make(0.0), make(0.5, x_m=60.0)]
    assert factor("position_speed", honest, ego) == 1.0
    assert factor("position_speed", jump, ego) == 0.0
    assert factor("position_speed", [make(0.0), make(5.0, x_m=0.0)], ego) == 1.0  # too long ago


def test_heading(make: Make, ego: ReceivingVehicle) -> None:
    assert factor("heading", [make(0.0), make(0.5)], ego) == 1.0
    assert factor("heading", [make(0.0), make(0.5, yaw_rad=np.pi)], ego) == 0.0
    assert factor("heading", [make(0.0), make(0.5, yaw_rad=np.pi, speed_mps=0.5)], ego) == 1.0  # too slow


def test_intersection(make: Make, ego: ReceivingVehicle) -> None:
    """The very same box, told 0.4 s before: 1.01 - 1 * (1 - 0.4 / 2)."""
    pair = [make(0.0, station_id=8, x_m=4.0), make(0.4, x_m=4.0)]
    assert factor("intersection", pair, ego) == pytest.approx(1.01 - 0.8)
    apart = [make(0.0, station_id=8, x_m=40.0), make(0.4, x_m=4.0)]
    assert factor("intersection", apart, ego) == 1.0


def test_flags_what_is_below_one_half(make: Make, ego: ReceivingVehicle) -> None:
    claims = [make(0.0), make(0.4), make(0.8, x_m=80.0), Claim(-1, 0, 0)]
    flags = catch_flags(catch_messages(claims, [ego] * 4), PARAMETERS)
    assert flags.tolist() == [False, False, True, True]


def test_an_old_box_hides_no_new_one(make: Make, ego: ReceivingVehicle) -> None:
    """Wholly on a box of 4 s ago, which counts for nothing, and for 60 % on one of 0.1 s ago."""
    stream = [make(0.0, 8, x_m=40.0), make(3.9, 9, x_m=41.6), make(4.0, 7, x_m=40.0)]
    expected = 1.01 - 0.6 * (1 - 0.1 / 2)
    assert factor("intersection", stream, ego, max_intersection_s=2.0) == pytest.approx(expected)
