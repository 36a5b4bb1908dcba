from __future__ import annotations

import pytest
from v2x_lane import BEGIN_NS, MS, context, decoded, edited, lane, time_s

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.facilities.ldm import LocalDynamicMap, Verdict
from advpipe.pipeline.v2x.section import LdmRules
from advpipe.stages.attack.v2x.delay import Delay, Stale

DRIVE = lane({1: 0.0, 2: 50.0}, 30)


def of(messages, station):
    return [one for one in messages if one.station_id == station]


def test_delayed_messages_are_sent_unchanged():
    """Sent 10 ms after each step's begin, 0.25 s late: the last of thirty that leaves is that of 2.6 s."""
    before = [one for step in DRIVE for one in step.sent]
    after = edited(Delay(context("cam-delay"), delay_min_s=0.25, delay_max_s=0.25), DRIVE)
    assert of(after, 2) == of(before, 2)
    late = of(after, 1)
    assert [one.number for one in late] == [1000 * index + 1 for index in range(28)]
    assert [one.payload for one in late] == [one.payload for one in of(before, 1)[:28]]
    assert {a.request_ns - b.request_ns for a, b in zip(late, of(before, 1), strict=False)} == {250 * MS}
    assert time_s(late[-1].request_ns) == pytest.approx(2.96)


def test_each_attacker_has_its_own_delay():
    attack = Delay(context("cam-delay", attackers=(1, 2)), delay_min_s=0.2, delay_max_s=1.0)
    after = edited(attack, DRIVE)
    delays_s = [time_s(of(after, station)[0].request_ns) - station / 100 for station in (1, 2)]
    assert all(0.2 <= delay <= 1.0 for delay in delays_s)
    assert delays_s[0] != delays_s[1]


@pytest.mark.parametrize(
    ("delay_s", "restamp", "verdict"),
    [
        (1.0, False, Verdict.ACCEPTED),  # kept for 1.1 s after its generation
        (1.2, False, Verdict.EXPIRED),
        (1.2, True, Verdict.ACCEPTED),
        (2.5, False, Verdict.EXPIRED),
    ],
)
def test_ldm_verdicts_on_delayed_messages(delay_s, restamp, verdict):
    attack = Delay(context("cam-delay"), delay_min_s=delay_s, delay_max_s=delay_s, restamp=restamp)
    known, found = LocalDynamicMap(LdmRules()), set()
    for one in of(edited(attack, DRIVE), 1):
        report = decoded(one)[1]
        assert report.front_m[0] == pytest.approx(
            10 * (time_s(one.request_ns) - delay_s - 0.01) + 2.25, abs=0.02
        )
        found.add(known.receive(report, one.request_ns))
    assert found == {verdict}


def test_a_delay_of_a_whole_time_cycle_is_accepted_as_fresh():
    """generationDeltaTime counts 65.536 s: what was held back so long says the time of now."""
    drive = [
        step._replace(sent=step.sent if index == 0 else ()) for index, step in enumerate(lane({1: 0.0}, 660))
    ]
    after = edited(Delay(context("cam-delay"), delay_min_s=65.536, delay_max_s=65.536), drive)
    assert [time_s(one.request_ns) for one in after] == [pytest.approx(65.546)]
    report = decoded(after[0])[1]
    assert report.generation_ns == BEGIN_NS + 65_536 * MS
    assert report.front_m[0] == pytest.approx(2.25, abs=0.02)


def test_messages_of_a_departed_attacker_are_never_sent():
    drive = lane({1: 0.0, 2: 50.0}, 30, leaves={1: 10})
    after = edited(Delay(context("cam-delay"), delay_min_s=0.5, delay_max_s=0.5), drive)
    assert [one.number for one in of(after, 1)] == [1, 1001, 2001, 3001, 4001]


def test_stale_claims_the_state_of_five_messages_ago():
    """At 2.0 s: where it was at 1.5 s, 15 m + 2.25 m, with the time of now."""
    after = of(edited(Stale(context("cam-stale"), messages=5), DRIVE), 1)
    assert [one.payload for one in after[:5]] == [step.sent[0].payload for step in DRIVE[:5]]
    report = decoded(after[20])[1]
    assert report.front_m[0] == pytest.approx(17.25, abs=0.02)
    assert report.generation_ns == BEGIN_NS + 2000 * MS


def test_stale_without_restamp_keeps_the_old_time():
    after = of(edited(Stale(context("cam-stale"), messages=5, restamp=False), DRIVE), 1)
    assert decoded(after[20])[1].generation_ns == BEGIN_NS + 1500 * MS


def test_stale_uses_messages_from_before_the_attack():
    attack = Stale(context("cam-stale", active=lambda time_ns: time_s(time_ns) >= 2.0), messages=5)
    after = of(edited(attack, DRIVE), 1)
    assert decoded(after[19])[1].front_m[0] == pytest.approx(21.25, abs=0.02)
    assert decoded(after[20])[1].front_m[0] == pytest.approx(17.25, abs=0.02)


@pytest.mark.parametrize("messages", [0, 1.5, True])
def test_bad_parameters(messages):
    with pytest.raises(AdvpipeError, match="cam-stale: messages is"):
        Stale(context("cam-stale"), messages=messages)
    with pytest.raises(AdvpipeError, match="delay_min_s, 3, is above delay_max_s, 2"):
        Delay(context("cam-delay"), delay_min_s=3, delay_max_s=2)
