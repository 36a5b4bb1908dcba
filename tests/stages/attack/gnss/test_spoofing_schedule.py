"""Schedules of several attacks on one victim."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.gnss.spoofing_schedule import SpoofingSchedule
from advpipe.stages.attack.recording import RecordedTimes

START_NS = 5_000_000_000
TEN_SECONDS = RecordedTimes(START_NS, START_NS + 10_000_000_000)


def offsets(*specs: dict, seed: int = 1) -> list[float | None]:
    """To the east, of fixes once a second on a straight road to the east at 10 m/s; None where left alone."""
    schedule = SpoofingSchedule("ego", [attack_spec(spec) for spec in specs], TEN_SECONDS, seed)
    found = []
    for second in range(11):
        genuine = np.array([10.0 * second, 0, 0])
        false_fix = schedule.of(
            START_NS + second * 1_000_000_000, genuine, 0.0, lambda: pytest.fail("no filter")
        )
        found.append(None if false_fix is None else round(float(false_fix.position_m[0] - genuine[0]), 9))
    return found


AHEAD = {"type": "gnss-drift", "parameters": {"rate_mps": 1.0, "angle_deg": 0.0}}


def test_from_and_to():
    schedule = {"from_s": 3, "to_s": 6}
    assert offsets({**AHEAD, "schedule": schedule}) == [None] * 3 + [0, 1, 2] + [None] * 5


def test_each_period_begins_anew():
    schedule = {"kind": "periodic", "from_s": 1, "period_s": 4, "on_s": 2}
    assert offsets({**AHEAD, "schedule": schedule}) == [
        *(None, 0, 1, None, None),
        *(0, 1, None, None, 0, 1),
    ]


def test_one_after_the_other():
    found = offsets(
        {**AHEAD, "schedule": {"to_s": 2}},
        {"type": "gnss-replay", "parameters": {"delay_s": 3}, "schedule": {"from_s": 5, "to_s": 7}},
    )
    assert found == [0, 1, None, None, None, -30, -30, *[None] * 4]


def test_by_chance():
    schedule = {"kind": "random", "probability": 0.5}
    first = offsets({"type": "gnss-freeze", "schedule": schedule})
    assert first == offsets({"type": "gnss-freeze", "schedule": schedule})
    assert None in first
    assert 0 in first
    other = [offsets({"type": "gnss-freeze", "schedule": schedule}, seed=seed) for seed in range(2, 6)]
    assert any(one != first for one in other)


def test_a_bias_is_the_same_in_each_period():
    schedule = {"kind": "periodic", "period_s": 2, "on_s": 1}
    found = [one for one in offsets({"type": "gnss-bias", "schedule": schedule}) if one is not None]
    assert len(found) == 6
    assert len(set(found)) == 1


def test_refuses_two_at_once():
    with pytest.raises(AdvpipeError, match="gnss-drift and gnss-jam both spoof ego at the same time"):
        offsets({**AHEAD, "schedule": {"to_s": 5}}, {"type": "gnss-jam", "schedule": {"from_s": 4}})


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (
            {**AHEAD, "schedule": {"from_s": 10.5}},
            "schedule begins at 10.5 s, but the recording ends at 10 s",
        ),
        (
            {"type": "gnss-drift", "parameters": {"rate": 1}},
            "unknown parameter 'rate'; did you mean 'rate_mps'",
        ),
        ({"type": "gnss-freeze", "parameters": {"rate": 1}}, "unknown parameter 'rate'; it has none"),
        ({"type": "gnss-drift", "parameters": {"rate_mps": "fast"}}, "rate_mps is 'fast'"),
        ({"type": "gnss-nothing"}, "unknown attack 'gnss-nothing'"),
    ],
)
def test_refuses(spec, message):
    with pytest.raises(AdvpipeError, match=message):
        offsets(spec)
