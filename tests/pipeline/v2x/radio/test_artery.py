"""Reception by distance as in a recorded run of Artery (ADVPIPE_ARTERY names its folder)."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.stations import Outcome
from advpipe.pipeline.v2x.section import Radio

from .artery import FREE_SPACE, NAKAGAMI, Trace, by_distance


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("radio", "name"),
    [(FREE_SPACE, "prr_freespace.csv"), (NAKAGAMI, "prr_nakagami.csv")],
    ids=["free", "nakagami"],
)
def test_reception_by_distance_is_within_five_points_of_artery(radio: Radio, name: str) -> None:
    trace = Trace.recorded()
    table = trace.table(name)
    edges_m = np.append(table["dist_from_m"], table["dist_to_m"][-1]).astype(np.float64)
    pairs, received = by_distance(trace.send_again(radio), edges_m)
    np.testing.assert_array_equal(pairs, table["pairs"])
    points = 100 * (received - table["received"]) / pairs
    print(f"{name}: at most {np.abs(points).max():.2f} points apart")
    assert np.abs(points).max() < 5


@pytest.mark.oracle
def test_single_receptions_and_delays_in_free_space_equal_arterys() -> None:
    """Without random draws, nearly every pair has the same outcome, and nearly every delay is the same."""
    trace = Trace.recorded()
    same = pairs = 0
    apart_us: list[float] = []
    for outcomes in trace.send_again(FREE_SPACE):
        for row, message in enumerate(outcomes.messages):
            mask = int(trace.cams["rx_mask"][message], 16)
            in_artery = np.array([mask >> int(k) & 1 for k in outcomes.receivers], np.bool_)
            here = outcomes.outcome[row] == Outcome.RECEIVED
            others = outcomes.outcome[row] != Outcome.OWN
            same += int((in_artery == here)[others].sum())
            pairs += int(others.sum())
            if in_artery.any() and here.any():
                delay_us = (outcomes.end_ns[row] + outcomes.delay_ns[row].max()) / 1e3 - trace.cams["t"][
                    message
                ] * 1e6
                apart_us.append(delay_us - trace.cams["max_delay_us"][message])
    assert pairs > 170_000
    assert same / pairs > 0.999
    assert np.mean(np.abs(apart_us) <= 1) > 0.95
