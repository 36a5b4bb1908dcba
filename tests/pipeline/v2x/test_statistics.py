"""Counting, on a step that a person can count, and on a drive through the medium."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from advpipe.pipeline.v2x.plot import draw_statistics
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.radio.medium import Medium, Step
from advpipe.pipeline.v2x.radio.stations import Outcome, ReceptionOutcomes, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio
from advpipe.pipeline.v2x.statistics import Statistics, Tally, delivery_by_distance

MS = 1_000_000
OWN, RECEIVED, WEAK = Outcome.OWN, Outcome.RECEIVED, Outcome.WEAK


def step(at_ms: int) -> Step:
    """Station 1 sends then; station 2, 60 m away, receives it 1 ms later; station 3, at 70 m, does not."""
    request_ns = np.array([at_ms * MS])
    outcomes = ReceptionOutcomes(
        messages=np.array([0]),
        senders=np.array([1]),
        request_ns=request_ns,
        start_ns=request_ns,
        end_ns=request_ns + MS,
        receivers=np.array([1, 2, 3]),
        outcome=np.array([[OWN, RECEIVED, WEAK]], np.uint8),
        power_dbm=np.zeros((1, 3)),
        sinr_db=np.zeros((1, 3)),
        distance_m=np.array([[0.0, 60, 70]]),
        delay_ns=np.zeros((1, 3), np.int64),
        dropped=np.array([5]),
    )
    return Step(outcomes, (ChannelLoad(at_ms * MS, np.array([1, 2, 3]), np.array([0.1, 0.2, 0.3])),))


def counted() -> Statistics:
    tally = Tally()
    for at_ms in (100, 200, 500):
        tally.add(step(at_ms))
    return tally.statistics()


def test_statistics_equal_values_computed_by_hand() -> None:
    statistics = counted()
    assert statistics.pairs[:3] == (0, 6, 0)
    assert statistics.received[:3] == (0, 3, 0)
    assert statistics.delivery_ratio[1] == 0.5
    assert np.isnan(statistics.delivery_ratio[0])
    assert (statistics.outcomes["own"], statistics.outcomes["weak"], statistics.outcomes["noise"]) == (
        3,
        3,
        0,
    )
    assert (statistics.stations, statistics.cams, statistics.dropped) == (1, 3, 3)
    assert statistics.rates_hz == (5.0,)  # two intervals in 0.4 s
    assert [index for index, count in enumerate(statistics.intervals) if count] == [2, 6]  # 0.1 s, 0.3 s
    assert statistics.delay_mean_s == statistics.delay_max_s == pytest.approx(0.001)
    assert statistics.busy_mean == pytest.approx((0.2, 0.2, 0.2))
    assert statistics.busy_max == (0.3, 0.3, 0.3)


def test_the_summary_names_rates_delivery_and_load() -> None:
    assert counted().lines() == [
        ("CAMs", "3 of 1 station"),
        ("CAM rate", "5.0 Hz on average, 5.0 to 5.0 Hz"),
        ("packets delivered", "50 % at 50 to 100 m"),
        ("channel busy", "20.0 % on average, 30.0 % at most"),
        ("CAMs dropped", "3, never sent"),
    ]


def test_statistics_round_trip_through_json() -> None:
    statistics = counted()
    assert from_json(statistics.to_json()) == statistics
    for text in ("{}", "[1]", '{"pairs": []}'):
        with pytest.raises(ValidationError):
            from_json(text)


@pytest.mark.parametrize(
    "changed",
    [
        {"pairs": []},
        {"pairs": 1},
        {"pairs": [-1] * 30},
        {"pairs": [True] * 30},
        {"pairs": [2**63] * 30},
        {"received": [10**6] * 30},
        {"outcomes": []},
        {"delay_mean_s": "1"},
        {"cams": 1.5},
        {"rates_hz": [2.0, 1.0]},
        {"rates_hz": [None]},
        {"busy_ns": []},
        {"busy_mean": [7.0]},
    ],
    ids=str,
)
def test_invalid_statistics_are_refused(changed: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        from_json(json.dumps(json.loads(counted().to_json()) | changed))


def from_json(text: str) -> Statistics:
    return TypeAdapter(Statistics).validate_json(text)


def test_bins_are_half_open() -> None:
    distance_m = np.array([0.0, 9.9, 10.0, 20.0, np.inf])
    pairs, delivered = delivery_by_distance(distance_m, np.array([True, False, True, True, True]), 10, 2)
    assert (pairs.tolist(), delivered.tolist()) == ([2, 1], [1, 1])


def drive() -> Statistics:
    rng = np.random.default_rng(1)
    medium, tally, ids = Medium(Radio(), seed=1), Tally(), np.arange(30)
    antenna_m = np.column_stack([rng.uniform(0, 900, 30), np.zeros(30), np.full(30, 1.5)])
    for number in range(10):
        request_ns = number * 100 * MS + rng.integers(0, 100 * MS, 30)
        sent = Transmissions(ids, message_keys(ids, request_ns), ids, request_ns, np.full(30, 200))
        tally.add(medium.advance((number + 1) * 100 * MS, Stations(ids, antenna_m), sent))
    return tally.statistics()


def test_statistics_of_a_simulated_drive_are_consistent() -> None:
    statistics = drive()
    assert sum(statistics.outcomes.values()) == 30 * statistics.cams
    assert sum(statistics.pairs) == 29 * statistics.cams
    assert sum(statistics.received) == statistics.outcomes["received"]
    assert statistics.delivery_ratio[0] > 0.9
    assert statistics.delivery_ratio[0] > statistics.delivery_ratio[5] > statistics.delivery_ratio[12]
    assert len(statistics.busy_ns) == 10
    assert 0.0003 <= statistics.delay_mean_s < 0.002


@pytest.mark.parametrize(
    "statistics", [drive(), counted(), Tally().statistics()], ids=["drive", "three", "none"]
)
def test_the_picture_shows_what_was_counted(statistics: Statistics) -> None:
    figure = draw_statistics(statistics, "a drive")
    rates, intervals, delivery, load = figure.axes
    known = np.isfinite(statistics.delivery_ratio)
    np.testing.assert_allclose(delivery.lines[0].get_ydata(), 100 * statistics.delivery_ratio[known])
    assert [bar.get_height() for bar in intervals.patches] == list(statistics.intervals)
    assert sum(bar.get_height() for bar in rates.patches) == len(statistics.rates_hz)
    np.testing.assert_allclose(load.lines[1].get_ydata(), 100 * np.array(statistics.busy_mean))
