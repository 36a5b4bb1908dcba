"""The detector on streams made by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import OnlineDetector, judge_all

Make = Callable[..., Claim]
SIGMAS = ("position_speed", "drift", "heading", "turn", "acceleration", "impulse")
CONFIG = DetectorConfig(
    thresholds={
        **{name: check.rule for name, check in CHECKS.items() if check.rule is not None},
        **dict.fromkeys(SIGMAS, 6.0),
        **{"kalman": 40.0, "dynamics": 10.0, "speed": 30.0, "range": 900.0, "overlap": 0.2},
        **{"position": 3.0, "wrong_way": 1.6, "freshness": 0.3, "appearance": math.inf},
    }
)
"""Whatever the shipped thresholds are tuned to."""


def drive(make: Make, start_s: float = 0.0, stop_s: float = 8.0, **values: float) -> list[Claim]:
    return [make(0.4 * nth, **values) for nth in range(round(start_s / 0.4), round(stop_s / 0.4))]


def flags(claims: Sequence[Claim], ego: ReceivingVehicle, config: DetectorConfig = CONFIG) -> list[bool]:
    in_order = sorted(claims, key=lambda claim: claim.arrival_ns)
    return [bool(flag) for flag in judge_all(in_order, [ego] * len(claims), config).flagged]


def reasons(claim: Claim, before: Sequence[Claim], ego: ReceivingVehicle) -> set[str]:
    claims = [*before, claim]
    judged = judge_all(claims, [ego] * len(claims), CONFIG)
    return {name for name, bad in zip(CHECKS, judged.triggered(CONFIG)[-1], strict=True) if bad}


def test_honest_messages_pass(make: Make, ego: ReceivingVehicle) -> None:
    assert not any(flags(drive(make), ego))


def test_a_constant_offset_is_false_for_as_long_as_it_lasts(make: Make, ego: ReceivingVehicle) -> None:
    """After 4 s all positions are 30 m to the side; from the second false message on they are consistent."""
    false_ones = [one._replace(y_m=30.0) for one in drive(make, 4.0)]
    assert flags([*drive(make, stop_s=4.0), *false_ones], ego) == [False] * 10 + [True] * 10


def test_who_returns_to_the_truth_soon_is_believed(make: Make, ego: ReceivingVehicle) -> None:
    false_ones = [one._replace(y_m=30.0) for one in drive(make, 4.0, 5.6)]
    found = flags([*drive(make, stop_s=4.0), *false_ones, *drive(make, 5.6)], ego)
    assert found == [False] * 10 + [True] * 4 + [False] * 6


def test_pardon(make: Make, ego: ReceivingVehicle) -> None:
    """A jump to the side is pardoned once the messages after it agree for 2 s."""
    false_ones = [one._replace(y_m=30.0) for one in drive(make, 4.0)]
    lenient = replace(CONFIG, pardon_s=2.0)
    found = flags([*drive(make, stop_s=4.0), *false_ones], ego, lenient)
    assert found == [False] * 10 + [True] * 6 + [False] * 4


@pytest.mark.parametrize(("braking_mps2", "messages"), [(9.0, 5), (16.0, 10)])
def test_who_brakes_hard_is_believed_again_sooner(
    make: Make, ego: ReceivingVehicle, braking_mps2: float, messages: int
) -> None:
    """Between 3.6 and 4.0 s it brakes from 10 m/s, as tyres allow or harder, and goes on at that speed."""
    thresholds = {**CONFIG.thresholds, "dynamics": 5.0, "position_speed": 2.0, "acceleration": math.inf}
    strict = DetectorConfig(thresholds=thresholds, pardon_s=5.0, acceleration_pardon_s=1.5)
    speed_mps = 10.0 - 0.4 * braking_mps2
    at_4_m = 36.0 + 0.4 * (10.0 + speed_mps) / 2
    after = [
        one._replace(x_m=at_4_m + 0.4 * nth * speed_mps, speed_mps=speed_mps)
        for nth, one in enumerate(drive(make, 4.0))
    ]
    found = flags([*drive(make, stop_s=4.0), *after], ego, strict)
    assert found == [False] * 10 + [True] * messages + [False] * (10 - messages)


def test_masquerade_does_not_taint_the_true_station(make: Make, ego: ReceivingVehicle) -> None:
    """From 4 s on another claims the same id from 200 m away, 0.2 s after each true message."""
    false = [make(0.4 * nth + 0.2, x_m=0.4 * nth * 10 - 200.0, y_m=50.0) for nth in range(10, 20)]
    true = drive(make)
    judged = sorted([*true, *false], key=lambda one: one.arrival_ns)
    assert flags(judged, ego) == [one in false for one in judged]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"speed_mps": 16.0}, "position_speed"),
        ({"yaw_rad": math.pi}, "heading"),
        ({"yaw_rad": 0.3}, "turn"),
        ({"acceleration_mps2": -6.0, "speed_mps": 7.0, "x_m": 83.4}, "acceleration"),
        ({"length_m": 12.0}, "size"),
        ({"station_type": 6}, "identity"),
        ({"x_m": 2000.0}, "range"),
        ({"speed_mps": 60.0}, "speed"),
        ({"x_m": 140.0}, "kalman"),
        ({"off_road_m": 20.0}, "position"),
        ({"wrong_way_rad": math.pi}, "wrong_way"),
        ({"acceleration_mps2": 16.0}, "dynamics"),
        ({"invalid": 1}, "format"),
    ],
)
def test_each_check_objects(
    make: Make, ego: ReceivingVehicle, changes: dict[str, float], reason: str
) -> None:
    """The message at 8.0 s says something else than an honest one: x 80 m, 10 m/s, along +x."""
    if reason == "acceleration":  # it says that it brakes, and goes on as before
        changes = {"acceleration_mps2": -6.0}
        before = [one._replace(acceleration_mps2=-6.0) for one in drive(make)]
    else:
        before = drive(make)
    assert reason in reasons(make(8.0, **changes), before, ego)


def test_own_id_from_elsewhere(make: Make, ego: ReceivingVehicle) -> None:
    assert reasons(make(station_id=ego.station_id), [], ego) == {"identity"}


def test_copies_are_flagged_and_originals_are_not(make: Make, ego: ReceivingVehicle) -> None:
    copies = [one._replace(arrival_ns=one.arrival_ns + 100_000_000) for one in drive(make)]
    assert flags([*drive(make), *copies], ego) == [False, True] * 20


def test_old_messages(make: Make, ego: ReceivingVehicle) -> None:
    late = make(8.0)._replace(arrival_ns=make(8.0).arrival_ns + 2_000_000_000)
    assert "freshness" in reasons(late, drive(make), ego)


def test_two_in_one_place(make: Make, ego: ReceivingVehicle) -> None:
    """A second station drives half a metre beside the first: the one known for a shorter time is flagged."""
    ghost_vehicle = drive(make, 4.0, station_id=9, y_m=0.5)
    claims = [*drive(make), *(one._replace(arrival_ns=one.arrival_ns + 1) for one in ghost_vehicle)]
    assert flags(claims, ego) == [False] * 10 + [False, True] * 10


def test_cars_side_by_side_are_not_in_one_place(make: Make, ego: ReceivingVehicle) -> None:
    """Both err by half a metre: their claimed boxes, 2 m wide, are 1.2 m apart."""
    beside = drive(make, 4.0, station_id=9, y_m=1.2)
    claims = [*drive(make), *(one._replace(arrival_ns=one.arrival_ns + 1) for one in beside)]
    assert not any(flags(claims, ego))


def test_who_pulls_out_across_the_lane_is_soon_trusted(make: Make, ego: ReceivingVehicle) -> None:
    """Only the road map speaks against the first message; against other faults, 30 s count."""
    pulls_out = [make(wrong_way_rad=2.0), *drive(make, 0.4)]
    assert flags(pulls_out, ego) == [True] * 4 + [False] * 16
    brakes_too = [make(wrong_way_rad=2.0, acceleration_mps2=-15.0), *drive(make, 0.4)]
    assert flags(brakes_too, ego) == [True] * 20


def test_on_top_of_the_receiver(make: Make, ego: ReceivingVehicle) -> None:
    assert "overlap" in reasons(make(x_m=ego.x_m, y_m=ego.y_m, speed_mps=0.0), [], ego)


def test_no_cam(make: Make, ego: ReceivingVehicle) -> None:
    assert reasons(Claim(-1, make(8.0).arrival_ns, 0), drive(make), ego) == {"decoding"}


def test_sudden_appearance(make: Make, ego: ReceivingVehicle) -> None:
    config = CONFIG.with_thresholds({"appearance": 200.0})
    far, near = make(4.0, station_id=8, x_m=50.0), make(4.0, station_id=9, x_m=-60.0)
    first = make(0.5, station_id=10, x_m=-60.0)  # while everybody is new
    assert flags([make(0.0), first, far, near], ego, config) == [False, False, False, True]


def test_small_false_speeds_add_up(make: Make, ego: ReceivingVehicle) -> None:
    """1 m/s too fast: after 3 s the way is 3 m too short, though each step of 0.4 m passes."""
    config = CONFIG.with_thresholds({"position_speed": CONFIG.thresholds["position_speed"], "drift": 6.0})
    found = flags([one._replace(speed_mps=11.0) for one in drive(make)], ego, config)
    assert found[:3] == [False] * 3
    assert any(found)
    alone = flags(
        [one._replace(speed_mps=11.0) for one in drive(make)],
        ego,
        config.with_thresholds({"position_speed": CONFIG.thresholds["position_speed"]}),
    )
    assert not any(alone)


def test_a_minute_of_a_hundred_stations_is_quick_and_the_same_again(
    make: Make, ego: ReceivingVehicle
) -> None:
    claims = [
        make(0.4 * nth, station_id=10 + station, y_m=8.0 * station)
        for nth in range(10)
        for station in range(20)
    ]
    one, other = (judge_all(claims, [ego] * len(claims), CONFIG) for _ in range(2))
    np.testing.assert_array_equal(one.statistics, other.statistics)
    assert not one.flagged.any()


def test_unknown_checks_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown check 'hunch'; known: decoding"):
        DetectorConfig(thresholds={"hunch": 1.0})


def test_a_flood_of_names_is_forgotten(make: Make, ego: ReceivingVehicle) -> None:
    """100 s of a new station each 0.1 s: none is kept for more than twice `memory_s`."""
    detector, most = OnlineDetector(CONFIG), 0
    for nth in range(1000):
        detector.judge(make(0.1 * nth, 1000 + nth), ego)
        most = max(most, len(detector._stations))
    assert most <= 2 * CONFIG.memory_s * 10 + 2


def test_a_false_speed_is_compared_with_the_newest_message_too(make: Make, ego: ReceivingVehicle) -> None:
    """Its place is right, its speed is 4 m/s too low, then 4 too high: a second after the last true one,
    4 m/s may be an acceleration, 8 m/s within 0.2 s may not."""
    config = replace(CONFIG, thresholds={**CONFIG.thresholds, "position_speed": 50.0, "acceleration": 12.0})
    claims = [make(0.2 * n) for n in range(4)]
    claims += [make(0.6 + 0.2 * n, speed_mps=6.0 if n % 2 else 14.0) for n in range(1, 8)]
    found = judge_all(claims, [ego] * len(claims), config)
    assert found.flagged.tolist() == [False] * 4 + [True] * 7
