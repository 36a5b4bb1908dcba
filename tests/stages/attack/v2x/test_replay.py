from __future__ import annotations

import pytest
from v2x_lane import BEGIN_NS, MS, STEP_NS, context, decoded, edited, lane, time_s

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.facilities.ldm import LocalDynamicMap, Verdict
from advpipe.pipeline.v2x.section import LdmRules
from advpipe.stages.attack.v2x.replay import CamReplay, DisruptiveReplay

DRIVE = lane({1: 0.0, 2: 50.0}, 40)


def of(messages, station):
    return [one for one in messages if one.station_id == station]


def test_it_replays_another_stations_message_of_a_second_ago():
    """At 2.01 s, station 2's last message of more than 1 s ago is that of 0.92 s: where it was at 0.9 s."""
    after = edited(CamReplay(context("cam-replay"), age_s=1.0), DRIVE)
    assert of(after, 2) == [one for step in DRIVE for one in step.sent if one.station_id == 2]
    message = next(one for one in of(after, 1) if one.request_ns == BEGIN_NS + 2010 * MS)
    cam, report = decoded(message)
    assert cam.station_id == 1
    assert report.front_m[0] == pytest.approx(50 + 10 * 0.9 + 2.25, abs=0.02)
    assert report.generation_ns == BEGIN_NS + 2000 * MS
    first = next(one for one in of(after, 1) if decoded(one)[1].front_m[0] > 40)
    assert time_s(first.request_ns) == pytest.approx(1.11)  # 2 has sent at 0.02 s, more than 1 s ago by then


def test_replay_with_the_original_id_and_time():
    """At 2.01 s, maps keep what was generated at 0.9 s; their last CAM of it expires at 2.0 s."""
    attack = CamReplay(context("cam-replay"), age_s=1.0, identity="theirs", restamp=False)
    message = next(one for one in of(edited(attack, DRIVE), 1) if one.request_ns == BEGIN_NS + 2010 * MS)
    cam, report = decoded(message)
    assert cam.station_id == 2
    assert report.generation_ns == BEGIN_NS + 900 * MS
    assert LocalDynamicMap(LdmRules()).receive(report, message.request_ns) is Verdict.EXPIRED


def test_future_times_block_genuine_messages_in_ldms():
    """Generated 0.5 s ahead under the other's id: its own messages are then rejected."""
    attack = CamReplay(context("cam-replay"), age_s=0.0, identity="theirs", ahead_s=0.5)
    known, verdicts = LocalDynamicMap(LdmRules()), {1: [], 2: []}
    for one in edited(attack, DRIVE):
        cam, report = decoded(one)
        if cam.station_id == 2:
            verdicts[one.station_id].append(known.receive(report, one.request_ns))
    assert set(verdicts[1]) == {Verdict.ACCEPTED}
    assert verdicts[2][0] is Verdict.ACCEPTED
    assert set(verdicts[2][1:]) == {Verdict.SUPERSEDED}


def test_it_replays_several_messages_of_each_station():
    """Three others, 50 m apart: runs of exactly two messages, unless the same one is drawn again."""
    drive = lane({1: 0.0, 2: 50.0, 3: 100.0, 4: 150.0}, 60)
    attack = CamReplay(context("cam-replay"), age_s=0.0, messages_min=2, messages_max=2)
    followed = []
    for one in of(edited(attack, drive), 1)[1:]:
        before_m = decoded(one)[1].front_m[0] - 10 * time_s(one.request_ns)
        followed.append(round(before_m / 50))
    assert set(followed) == {1, 2, 3}
    assert all(followed[i] == followed[i + 1] for i in range(0, len(followed) - 1, 2))


@pytest.mark.parametrize("settings", [{"range_m": 49.0}, {"age_s": 10.0}])
def test_without_overheard_messages_nothing_is_changed(settings):
    after = edited(CamReplay(context("cam-replay"), **settings), DRIVE)
    assert after == [one for step in DRIVE for one in step.sent]


def test_it_replays_only_while_active():
    until_ns = BEGIN_NS + 20 * STEP_NS
    attack = CamReplay(context("cam-replay", active=lambda time_ns: time_ns >= until_ns), age_s=0.0)
    changed = [
        one.number
        for one, old in zip(edited(attack, DRIVE), [o for s in DRIVE for o in s.sent], strict=True)
        if one != old
    ]
    assert changed == [1000 * index + 1 for index in range(20, 40)]


def test_disruptive_replay_uses_any_message_of_the_last_seconds():
    """With a memory of 1 s, at 3.01 s: the messages of station 2 from 2.0 s to before the step."""
    after = edited(DisruptiveReplay(context("cam-disruptive-replay"), memory_s=1.0), DRIVE)
    ages_s = []
    for one in of(after, 1)[1:]:
        cam, report = decoded(one)
        assert cam.station_id == 1
        ages_s.append(time_s(one.request_ns) - (report.front_m[0] - 52.25) / 10)
    assert 0.1 < min(ages_s) < 0.3
    assert 0.6 < max(ages_s) < 1.12
    assert len({round(age, 1) for age in ages_s}) > 5


def test_same_seed_same_messages():
    first, again, other = (
        [one.payload for one in edited(DisruptiveReplay(context("x", seed=seed)), DRIVE)]
        for seed in (5, 5, 6)
    )
    assert first == again != other


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"identity": "mine"}, "identity is 'mine'; known: own, theirs"),
        ({"age_s": -1}, "age_s is -1; it takes a number, 0 to 600"),
        ({"messages_min": 9}, "messages_min, 9, is above messages_max, 8"),
        ({"ahead_s": "soon"}, "ahead_s is 'soon'; it takes a number"),
    ],
)
def test_bad_parameters(settings, message):
    with pytest.raises(AdvpipeError, match=message):
        CamReplay(context("cam-replay"), **settings)
