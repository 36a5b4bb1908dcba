"""The generation rules of CPMs (TS 103 324, 6.1), one at a time."""

from __future__ import annotations

from dataclasses import replace

from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.cpm import PerceivedObject
from advpipe.pipeline.v2x.facilities.cpm_generation import CpmGenerator, GeneratedCpm
from advpipe.pipeline.v2x.facilities.station_state import StationState

STEP_NS = 100_000_000
START_NS = 1_800_000_000 * 10**9
STATE = StationState(
    station_id=1,
    station_type=5,
    time_ns=0,
    latitude_deg=48.1,
    longitude_deg=11.5,
    heading_rad=0.0,
    speed_mps=0.0,
    length_m=4.5,
    width_m=1.8,
)
CAR = PerceivedObject(
    object_id=1, measured_ms=0, east_m=20.0, north_m=0.0, east_mps=0.0, north_mps=0.0, label="car"
)
WALKER = replace(CAR, object_id=2, label="pedestrian")


def sent(objects_at, steps: int, rules: CpmRules | None = None, dcc_s: float = 0.0) -> list[GeneratedCpm]:
    """The CPMs of a station that perceives `objects_at(step)` at each check."""
    generator = CpmGenerator(rules or CpmRules())
    made = [
        generator.check(
            step * STEP_NS,
            replace(STATE, time_ns=1_800_000_000 * 10**9 + step * STEP_NS),
            objects_at(step),
            dcc_s,
        )
        for step in range(steps)
    ]
    return [one for one in made if one is not None]


def steps_with(found: list[GeneratedCpm], object_id: int) -> list[int]:
    return [
        one.time_ns // STEP_NS for one in found if object_id in {each.object_id for each in one.cpm.objects}
    ]


def test_a_standing_car_is_included_once_a_second() -> None:
    assert steps_with(sent(lambda _: [CAR], 21), 1) == [0, 10, 20]


def test_a_moving_car_is_included_every_four_metres() -> None:
    def moving(step: int) -> list[PerceivedObject]:
        return [replace(CAR, east_m=20 + 1.5 * step, east_mps=15.0)]

    assert steps_with(sent(moving, 10), 1) == [0, 3, 6, 9]  # the first with more than 4 m


def test_a_change_of_speed_or_direction_includes_a_car() -> None:
    def braking(step: int) -> list[PerceivedObject]:
        return [replace(CAR, east_mps=10 - 0.6 * step)]

    def turning(step: int) -> list[PerceivedObject]:
        return [replace(CAR, east_mps=10.0, north_mps=0.4 * step)]  # about 2.3 degrees a step

    assert steps_with(sent(braking, 3), 1) == [0, 1, 2]
    assert steps_with(sent(turning, 5), 1) == [0, 2, 4]


def test_pedestrians_are_included_together_every_half_second() -> None:
    other = replace(WALKER, object_id=3)

    def seen(step: int) -> list[PerceivedObject]:
        return [WALKER] if step < 2 else [WALKER, other]

    found = sent(seen, 13)
    assert steps_with(found, 2) == [0, 2, 7, 12]  # a new one includes all
    assert steps_with(found, 3) == [2, 7, 12]


def test_sensor_information_comes_once_a_second_even_without_objects() -> None:
    found = sent(lambda _: [], 25)
    assert [one.time_ns // STEP_NS for one in found] == [0, 10, 20]
    assert all(one.cpm.sensors and not one.cpm.objects for one in found)


def test_intervals_follow_congestion_control_and_the_rules() -> None:
    new = [[replace(CAR, object_id=step)] for step in range(10)]
    assert len(sent(lambda step: new[step], 10)) == 10
    assert len(sent(lambda step: new[step], 10, CpmRules(min_interval_s=0.5))) == 2
    assert len(sent(lambda step: new[step], 10, dcc_s=0.3)) == 4


def test_the_nearest_objects_come_first_and_others_wait() -> None:
    crowd = [replace(CAR, object_id=index, east_m=10.0 * (index + 1)) for index in range(5)]
    found = sent(lambda _: crowd, 3, CpmRules(max_objects=2))
    assert [[one.object_id for one in each.cpm.objects] for each in found] == [[0, 1], [2, 3], [4]]
    assert [each.cpm.perceived for each in found] == [5, 5, 5]
