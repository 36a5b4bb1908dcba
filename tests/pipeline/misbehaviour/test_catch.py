"""The baseline's checks: numbers of NextGen's own code, and some worked by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.catch import (
    CATCH_CHECKS,
    PUBLISHED_CATCH,
    CatchDetector,
    CatchParameters,
    catch_factors,
    catch_flags,
    catch_messages,
    travel_bounds_m,
)
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle

Make = Callable[..., Claim]
URBAN = PUBLISHED_CATCH["urban-2am"]

MESSAGES = (
    (7, 0.0, -2.41, -2.65, -0.149, 9.26, 1.7, 0.05, 0.055, 0.32),
    (8, 0.3, 5.25, 5.27, 0.164, 4.3, 1.44, 0.8, 0.02, 0.0),
    (9, 0.6, 5.75, 1.67, -0.378, 6.54, 1.07, 0.28, 0.006, 0.62),
    (7, 0.9, 10.23, 1.66, -0.986, 7.23, 1.47, 0.09, 0.129, 1.53),
    (8, 1.2, 11.89, 1.39, -0.629, 6.81, 1.64, 0.68, 0.022, 0.0),
    (9, 1.5, 335.9, 5.43, -1.199, 8.82, 1.65, 0.02, 0.004, 0.0),
    (7, 1.8, 17.3, -0.51, 0.577, 4.46, 1.11, 0.55, 0.033, 0.24),
    (8, 2.1, 25.35, 3.14, 1.459, 9.93, 1.27, 0.42, 0.061, 1.39),
    (9, 2.4, 28.05, 3.21, 0.113, 7.94, 0.91, 0.18, 0.015, 1.86),
    (7, 2.7, 27.31, -1.73, 0.537, 57.4, 1.8, 0.64, 0.097, 0.96),
    (8, 3.0, 27.09, -0.27, 0.253, 4.84, 1.91, 0.31, 0.12, 1.02),
    (9, 3.3, 32.98, 3.11, -0.032, 12.02, 0.78, 0.63, 0.184, 1.19),
)
"""Station, time, x, y, yaw, speed, confidences of position, speed and heading, distance from the road."""

NEXTGEN_FACTORS = (
    (1.0, 0.971307, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
    (1.0, 0.613288, 1.0, 1.0, 1.0, 0.0, 0.999967, 1.0),
    (1.0, 1.0, 1.0, 1.0, 0.60098, 0.243646, 1.0, 0.690762),
    (0.638856, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0),
    (1.0, 1.0, 1.0, 1.0, 1.0, 0.328778, 1.0, 1.0),
    (1.0, 0.698571, 1.0, 1.0, 0.358591, 0.0, 1.0, 1.0),
    (1.0, 0.45317, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0),
    (1.0, 0.783731, 0.403125, 1.0, 0.0, 0.0, 1.0, 0.99521),
    (1.0, 0.75043, 1.0, 1.0, 0.0, 0.530249, 0.800451, 0.581053),
    (1.0, 0.937374, 1.0, 1.0, 0.0, 0.555789, 1.0, 1.0),
)
"""What `catch_checks.py` of VeReMi NextGen at 1643972f returns for them with the parameters of its urban
simulation at 2 a.m., received at the origin by a vehicle that knows its place to 1 m; 6 digits."""


def claims_of_messages(make: Make) -> list[Claim]:
    return [
        make(
            time_s,
            station_id=station,
            **{"x_m": x, "y_m": y, "yaw_rad": yaw, "speed_mps": speed, "position_m": place},
            **{"speed_confidence_mps": fast, "heading_confidence_rad": turn, "off_road_m": off},
        )
        for station, time_s, x, y, yaw, speed, place, fast, turn, off in MESSAGES
    ]


def test_factors_are_those_of_nextgens_own_code(make: Make, ego: ReceivingVehicle) -> None:
    origin = ego._replace(x_m=0.0, y_m=0.0, position_m=1.0)
    claims = claims_of_messages(make)
    found = catch_factors(catch_messages(claims, [origin] * len(claims)), URBAN)
    np.testing.assert_allclose(found, NEXTGEN_FACTORS, rtol=1e-5, atol=1e-9)


def factor(name: str, claims: Sequence[Claim], ego: ReceivingVehicle, **changes: float) -> float:
    """Of the last message."""
    parameters = replace(URBAN, **changes)
    table = catch_factors(catch_messages(claims, [ego] * len(claims)), parameters)
    return float(table[-1, CATCH_CHECKS.index(name)])


def test_range(make: Make, ego: ReceivingVehicle) -> None:
    """The ego at x = -100 m: at 320 m half of the circle of 1 m is within, at 325 nothing, at 100 all."""
    for x_m, share in ((220.0, 0.5), (225.0, 0.0), (0.0, 1.0)):
        assert factor("range", [make(x_m=x_m, y_m=20.0)], ego, max_range_m=320.0) == pytest.approx(
            share, abs=0.01
        )


def test_speed(make: Make, ego: ReceivingVehicle) -> None:
    """Half of the confidence either way, as published: 40.05 ± 0.1 m/s is a quarter below 40."""
    assert factor("speed", [make(speed_mps=40.05)], ego, max_speed_mps=40.0) == pytest.approx(0.25)


def test_position(make: Make, ego: ReceivingVehicle) -> None:
    """A circle of 1 m half of which is beyond 2 m; one that stands may be anywhere; without roads, too."""
    assert factor("position", [make(off_road_m=2.0)], ego, max_off_road_m=2.0) == pytest.approx(0.5)
    parked = make(off_road_m=9.0, speed_mps=0.2)
    assert factor("position", [parked], ego) == 1.0
    assert factor("position", [make()], ego) == 1.0
    certain = make(off_road_m=2.1, position_m=0.0)
    assert factor("position", [certain], ego, max_off_road_m=2.0) == 0.0


def test_speed_consistency(make: Make, ego: ReceivingVehicle) -> None:
    """1.7 m/s in half a second at 3.2 m/s²: 0.1 more than the 1.6 allowed, of intervals of ± 0.2 m/s each."""
    faster = [make(0.0), make(0.5, speed_mps=11.7)]
    assert factor("speed_consistency", faster, ego, max_acceleration_mps2=3.2) == pytest.approx(0.375)


def test_shortest_and_longest_way() -> None:
    """2 s at 10 m/s are 20 m: 2 % of them either way; from 10 to 14 m/s in 2 s, 24 m and 5 %."""
    speeds, t = np.array([10.0]), np.array([2.0])
    least, most = travel_bounds_m(speeds, speeds, t, 4.0, 4.0)
    assert (least[0], most[0]) == (pytest.approx(19.6), pytest.approx(20.4))
    least, most = travel_bounds_m(speeds, np.array([14.0]), t, 4.0, 4.0)
    assert (least[0], most[0]) == (pytest.approx(24 - 24 * 0.05), pytest.approx(24 + 24 * 0.05))


def test_a_message_is_compared_with_the_one_generated_before_it(make: Make, ego: ReceivingVehicle) -> None:
    """It arrives late, after one that was generated later; the first of its station is compared with none."""
    honest = [make(0.0), make(0.8)]
    late = make(0.4)._replace(arrival_ns=honest[1].arrival_ns + 1)
    messages = catch_messages([*honest, late], [ego] * 3)
    assert messages.elapsed_s[1:].tolist() == [pytest.approx(0.4), pytest.approx(0.4)]
    assert math.isnan(messages.elapsed_s[0])


def test_flags_what_is_below_one_half(make: Make, ego: ReceivingVehicle) -> None:
    claims = [make(0.0), make(0.4), make(0.8, x_m=80.0), Claim(-1, 0, 0)]
    flags = catch_flags(catch_messages(claims, [ego] * 4), URBAN)
    assert flags.tolist() == [False, False, True, True]
    verdicts = CatchDetector(URBAN).judge(claims, [ego] * 4)
    assert verdicts.flagged.tolist() == flags.tolist()
    assert ((verdicts.scores > 0.5) == flags).all()
    assert set(verdicts.checks) == set(CATCH_CHECKS)


def test_boxes_of_others(make: Make, ego: ReceivingVehicle) -> None:
    """Two stations at one place cannot be; one from long ago, or the station itself, hides nothing."""
    pair = [make(0.0, station_id=8, x_m=4.0, y_m=0.3), make(0.1, x_m=4.0)]
    assert factor("intersection", pair, ego) < 0.5
    assert factor("intersection", pair, ego, max_intersection_s=0.05) == 1.0
    assert factor("intersection", [make(0.0, x_m=4.0, y_m=0.3), make(0.1, x_m=4.0)], ego) == 1.0


def test_the_published_table() -> None:
    assert list(PUBLISHED_CATCH) == ["urban-2am", "urban-7am", "highway-2am", "highway-7am"]
    assert isinstance(URBAN, CatchParameters)
    assert URBAN.max_heading_change_rad == pytest.approx(math.radians(71.385))
    assert (URBAN.max_off_road_m, URBAN.max_time_s, URBAN.margin_down_m) == (1.793, 3.666, 2.584)
