"""The rules of EN 302 637-2, 6.1.3, on courses whose CAMs can be listed by hand."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.facilities.generation import (
    CHECK_INTERVAL_NS,
    CamGenerator,
    Cause,
    GeneratedCam,
    GenerationRules,
    first_check_ns,
)
from advpipe.pipeline.v2x.facilities.station_state import StationState

Car = Callable[..., StationState]
DEGREES_PER_M = 1 / 111_200  # of latitude, at 48 degrees north
START_NS = 1_767_268_800_000_000_000


def run(
    states: Callable[[float], StationState], seconds: float, dcc_interval_s: float = 0.0
) -> dict[float, GeneratedCam]:
    """CAMs by the time since switch-on; checks at 0.1 s, 0.2 s and so on."""
    generator, sent = CamGenerator(START_NS), {}
    for check in range(1, round(seconds * 10) + 1):
        cam = generator.check(START_NS + check * CHECK_INTERVAL_NS, states(check / 10), dcc_interval_s)
        if cam is not None:
            sent[check / 10] = cam
    return sent


def test_a_standing_car_sends_once_a_second(car: Car) -> None:
    """The first CAM sets T_GenCam to the 0.1 s since switch-on, which three quiet CAMs then use up."""
    sent = run(lambda t: car(), 4)
    assert list(sent) == [0.1, 0.2, 0.3, 0.4, 1.4, 2.4, 3.4]
    assert sent[0.1].cause == Cause.FIRST
    assert {cam.cause for time, cam in sent.items() if time > 0.1} == {Cause.ELAPSED}


def test_a_fast_car_sends_for_its_position(car: Car) -> None:
    """At 25 m/s, 4 m are exceeded at every second check, once the short first interval is used up."""
    sent = run(lambda t: car(latitude_deg=48 + 25 * t * DEGREES_PER_M, speed_mps=25.0), 2)
    assert list(sent) == [0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0]
    assert all(cam.cause == Cause.POSITION for time, cam in sent.items() if time > 0.4)


def test_changes_have_to_exceed_the_threshold(car: Car) -> None:
    def steps(t: float) -> StationState:
        return car(speed_mps=0.5 * round(t), heading_rad=math.radians(3.999 * round(t)))

    causes = {cam.cause for cam in run(steps, 8).values()}
    assert causes == {Cause.FIRST, Cause.ELAPSED}


def test_a_change_of_heading_across_north_is_small(car: Car) -> None:
    def turn(t: float) -> StationState:
        return car(heading_rad=math.radians(358 if t < 3 else 2.5))

    sent = run(turn, 3.5)
    assert sent[3.0].cause == Cause.HEADING


def test_a_change_of_speed_sets_the_next_interval(car: Car) -> None:
    """A burst at 2.8 s, 0.4 s after the CAM before: three quiet CAMs in steps of 0.4 s, then 1 s."""
    sent = run(lambda t: car(speed_mps=0.0 if t < 2.75 else 0.6), 7)
    assert sent[2.8].cause == Cause.SPEED
    assert list(sent) == [0.1, 0.2, 0.3, 0.4, 1.4, 2.4, 2.8, 3.2, 3.6, 4.0, 5.0, 6.0, 7.0]


def test_congestion_control_slows_down(car: Car) -> None:
    fast = [run(lambda t: car(latitude_deg=48 + 50 * t * DEGREES_PER_M), 3, dcc) for dcc in (0.06, 0.26, 9.0)]
    assert [len(sent) for sent in fast] == [30, 10, 3]
    assert list(fast[1])[:3] == [0.3, 0.6, 0.9]
    assert list(fast[2]) == [1.0, 2.0, 3.0]  # never beyond T_GenCamMax


def test_without_a_last_interval_to_repeat_quiet_cams_come_after_the_longest(car: Car) -> None:
    """N_GenCam = 0: the car speeds up at 2.3 s; by the standard, three CAMs then follow 0.9 s apart."""

    def times(rules: GenerationRules) -> list[int]:
        generator, sent = CamGenerator(START_NS, rules), []
        for check in range(1, 60):
            state = car(speed_mps=10.0 if check >= 23 else 0.0)
            if generator.check(START_NS + check * CHECK_INTERVAL_NS, state) is not None:
                sent.append(check)
        return sent

    assert times(GenerationRules(low_dynamics_cams=0)) == [1, 11, 21, 23, 33, 43, 53]
    assert times(GenerationRules()) == [1, 2, 3, 4, 14, 23, 32, 41, 50]


def test_the_low_frequency_container_is_sent_every_half_second(car: Car) -> None:
    sent = run(lambda t: car(latitude_deg=48 + 50 * t * DEGREES_PER_M), 2)
    with_it = [time for time, cam in sent.items() if cam.cam.low_frequency is not None]
    assert with_it == [0.1, 0.6, 1.1, 1.6]


def test_the_payload_states_the_states_time_and_path(car: Car) -> None:
    def course(t: float) -> StationState:
        time_ns = START_NS + round(t * 1e9) - 37_000_000
        return car(latitude_deg=48 + 30 * t * DEGREES_PER_M, time_ns=time_ns, speed_mps=30.0)

    sent = run(course, 5)
    cam = decode_cam(sent[max(sent)].payload)
    assert cam.generation_delta_time_ms == ((START_NS // 10**6 - 1_072_915_200_000 + 5000) + 4963) % 65536
    latest = [cam for cam in sent.values() if cam.cam.low_frequency is not None][-1].cam
    assert latest.low_frequency is not None
    assert latest.latitude_deg is not None
    stated_m = [(p.delta_latitude_deg or 0) / DEGREES_PER_M for p in latest.low_frequency.path_history]
    assert sum(stated_m) == pytest.approx(-((latest.latitude_deg - 48) / DEGREES_PER_M - 3), abs=0.1)
    assert len(stated_m) > 3


def test_check_phases_differ_and_are_reproducible() -> None:
    phases = [first_check_ns(0, 7, station) for station in range(200)]
    assert phases == [first_check_ns(0, 7, station) for station in range(200)]
    assert min(phases) >= CHECK_INTERVAL_NS
    assert max(phases) < 2 * CHECK_INTERVAL_NS
    histogram, _ = np.histogram(phases, bins=4, range=(1e8, 2e8))
    assert histogram.min() > 30
    assert first_check_ns(0, 8, 0) != phases[0]
