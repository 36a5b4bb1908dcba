"""Outcomes of messages, from records of receptions."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.artery.recorded_medium import GIVEN_UP_NS, RecordedMedium
from advpipe.pipeline.artery.records import BusyRatio
from advpipe.pipeline.v2x.radio.stations import Outcome, Reception, Stations, Transmissions

STATIONS = Stations(np.array([5, 7, 9]), np.array([[0.0, 0, 1.5], [30, 40, 1.5], [0, 200, 1.5]]))


def sent(*messages: tuple[int, int, int]) -> Transmissions:
    numbers, senders, times_ns = np.array(messages, np.int64).reshape(-1, 3).T
    return Transmissions(numbers, numbers.astype(np.uint64), senders, times_ns, np.full(len(numbers), 100))


def test_a_reception_is_in_the_step_in_which_it_happens() -> None:
    medium = RecordedMedium()
    medium.note([Reception(0, 7, 990, -70.0, 20.0), Reception(1, 5, 1010, -71.0, 19.0)], [])
    first = medium.advance(1000, STATIONS, sent((0, 5, 950), (1, 7, 980)))
    assert first.outcomes.messages.tolist() == [0]
    assert first.outcomes.outcome.tolist() == [[Outcome.OWN, Outcome.RECEIVED, Outcome.WEAK]]
    assert first.outcomes.distance_m.tolist() == [[0.0, 50.0, 200.0]]
    assert [one.arrival_ns for one in first.outcomes.receptions()] == [990]
    assert first.outcomes.receptions()[0].power_dbm == -70.0
    second = medium.advance(2000, STATIONS, sent())
    assert second.outcomes.messages.tolist() == [1]
    assert second.outcomes.outcome.tolist() == [[Outcome.RECEIVED, Outcome.OWN, Outcome.WEAK]]


def test_a_message_that_nobody_receives_is_given_up() -> None:
    medium = RecordedMedium()
    assert not len(medium.advance(1000, STATIONS, sent((0, 9, 900))).outcomes.messages)
    assert not len(medium.advance(GIVEN_UP_NS, STATIONS, sent()).outcomes.messages)
    outcomes = medium.advance(900 + GIVEN_UP_NS, STATIONS, sent()).outcomes
    assert outcomes.messages.tolist() == [0]
    assert outcomes.outcome.tolist() == [[Outcome.WEAK, Outcome.WEAK, Outcome.OWN]]


def test_a_sender_that_has_left_is_at_no_distance() -> None:
    medium = RecordedMedium()
    medium.note([Reception(0, 7, 1000, -70.0, 20.0)], [])
    outcomes = medium.advance(2000, STATIONS, sent((0, 11, 900))).outcomes
    assert outcomes.outcome[0].tolist() == [Outcome.WEAK, Outcome.RECEIVED, Outcome.WEAK]
    assert np.isinf(outcomes.distance_m).all()


@pytest.mark.parametrize("step_ms", [50, 100, 1000])
def test_each_window_has_one_load_however_long_a_step_is(step_ms: int) -> None:
    """As from `Medium`: congestion control takes each load as the share of the last tenth of a second."""
    medium, loads = RecordedMedium(), list[tuple[int, list[int], list[float]]]()
    medium.note([], [BusyRatio(ms * 1_000_000, 5, ms / 1000) for ms in range(230, 1000, 100)])
    medium.note([], [BusyRatio(970_000_000, 7, 0.5), BusyRatio(1_030_000_000, 5, 1.0)])
    for end_ms in range(step_ms, 1001, step_ms):
        requests = sent((end_ms, 5, (end_ms - step_ms) * 1_000_000))
        for load in medium.advance(end_ms * 1_000_000, STATIONS, requests).loads:
            loads.append((load.end_ns // 1_000_000, load.stations.tolist(), load.busy_ratio.tolist()))
    assert loads == [
        *((end_ms, [5], [(end_ms - 70) / 1000]) for end_ms in range(300, 1000, 100)),
        (1000, [5, 7], [0.93, 0.5]),
    ]
