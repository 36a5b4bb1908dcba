"""The state machine's course, by hand from the table; the same turns as in Vanetza's own test of it."""

import math

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.facilities.dcc import ReactiveDcc


def fed(dcc: ReactiveDcc, load: float, samples: int) -> str:
    for _ in range(samples):
        dcc.update(load)
    return dcc.state


def test_fewer_messages_take_a_second_of_load() -> None:
    dcc = ReactiveDcc()
    assert (dcc.state, dcc.interval_s) == ("relaxed", 0.06)
    assert fed(dcc, 0.2, 9) == "relaxed"
    assert fed(dcc, 0.2, 1) == "active 1"
    assert dcc.interval_s == 0.1
    assert fed(dcc, 0.4, 1) == "active 3"
    assert dcc.interval_s == 0.26
    assert fed(dcc, 0.55, 1) == "active 5"
    assert fed(dcc, 0.6, 9) == "active 5"
    assert fed(dcc, 0.6, 1) == "restrictive"
    assert dcc.interval_s == 0.46


def test_more_messages_take_five_seconds_of_low_load() -> None:
    dcc = ReactiveDcc()
    assert fed(dcc, 0.7, 11) == "restrictive"
    assert fed(dcc, 0.55, 1) == "restrictive"
    assert fed(dcc, 0.5, 48) == "restrictive"
    assert fed(dcc, 0.5, 1) == "active 5"  # the 0.55 is the highest of 50
    assert fed(dcc, 0.5, 1) == "active 4"
    assert fed(dcc, 0.18, 49) == "active 4"
    assert fed(dcc, 0.18, 1) == "relaxed"


def test_one_quiet_sample_keeps_a_station_relaxed() -> None:
    dcc = ReactiveDcc()
    for _ in range(10):
        assert fed(dcc, 0.9, 9) == "relaxed"
        assert fed(dcc, 0.0, 1) == "relaxed"


@pytest.mark.parametrize("load", [-0.01, 1.01, math.nan])
def test_an_invalid_load_is_refused(load: float) -> None:
    with pytest.raises(AdvpipeError, match="channel load"):
        ReactiveDcc().update(load)
