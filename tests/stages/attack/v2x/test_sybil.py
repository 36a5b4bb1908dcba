from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from v2x_lane import BEGIN_NS, LENGTH_M, STEP_NS, context, decoded, edited, lane, radio, time_s

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.stages.attack.v2x.sybil import SybilCongestion, SybilGrid, SybilReplay, grid_cells

DRIVE = lane({1: 0.0, 2: 50.0}, 30)


def ghosts(attack, drive):
    return [one for one in edited(attack, drive) if one.number >= 10**6]


def by_ghost(messages):
    sent = {}
    for one in messages:
        sent.setdefault(decoded(one)[0].station_id, []).append(one)
    return sent


def test_grid_cells_are_nearest_first():
    assert grid_cells(5, 5.0, 2.0, 3) == [(0, 2), (0, -2), (5, 0), (-5, 0), (5, 2)]
    assert grid_cells(3, 5.0, 2.0, 1) == [(5, 0), (-5, 0), (10, 0)]
    assert len(set(grid_cells(40, 5.0, 2.0, 4))) == 40


@pytest.mark.parametrize(("around", "x_m"), [("attacker", 0.0), ("victim", 50.0)])
def test_the_grid_moves_with_the_attacker(around, x_m):
    """Five ghost vehicles at the cells beside the middle of a car at x + 10 t, with its speed."""
    sent = ghosts(SybilGrid(context("cam-sybil-grid", victim=2), around=around), DRIVE)
    assert {one.station_id for one in sent} == {1}
    found = by_ghost(sent)
    assert len(found) == 5
    assert not set(found) & {1, 2}
    places_m = set()
    for messages in found.values():
        for one in messages:
            cam, report = decoded(one)
            at_s = (report.generation_ns - BEGIN_NS) / 1e9
            centre_m = report.front_m[0] - LENGTH_M / 2 - x_m - 10 * at_s
            places_m.add((round(centre_m, 1) + 0.0, round(report.front_m[1], 1) + 0.0))
            assert cam.speed_mps == pytest.approx(10, abs=0.011)
    assert places_m == set(grid_cells(5, 5.0, 2.0, 3))


def test_attackers_share_the_cells_around_a_victim():
    """Two attackers, five ghost vehicles each: the ten cells next to the victim, each taken once."""
    attack = SybilGrid(context("cam-sybil-grid", attackers=(1, 3), victim=2), around="victim")
    sent = ghosts(attack, lane({1: 0.0, 2: 50.0, 3: 100.0}, 30))
    cells = {}
    for station_id, messages in by_ghost(sent).items():
        ahead_m, left_m = np.subtract(decoded(messages[-1])[1].centre_m[:2], (50.0, 0.0))
        at_s = (decoded(messages[-1])[1].generation_ns - BEGIN_NS) / 1e9
        cells[station_id] = round(ahead_m - 10 * at_s, 1) + 0.0, round(left_m, 1) + 0.0
    assert sorted(cells.values()) == sorted(grid_cells(10, 5.0, 2.0, 3))
    assert [sum(one.station_id == sender for one in sent) > 0 for sender in (1, 2, 3)] == [True, False, True]


def test_the_grid_keeps_the_generation_rules():
    """4 m and more are exceeded at 10 m/s after 0.4 to 0.5 s, at its own phase for each."""
    found = by_ghost(ghosts(SybilGrid(context("cam-sybil-grid")), DRIVE))
    for messages in found.values():
        assert set(np.diff([one.request_ns for one in messages])[3:].tolist()) <= {400_000_000, 500_000_000}
    assert len({messages[0].request_ns % STEP_NS for messages in found.values()}) == 5


def test_ghost_vehicles_in_a_bend_move_as_claimed():
    """On a circle of 20 m at 10 m/s: 0.5 rad/s; a ghost vehicle 5 m to the left is on one of 15 m."""
    drive = []
    for index in range(40):
        angle_rad = 0.5 * index / 10
        place = radio(1, 20 * np.sin(angle_rad), 20 * (1 - np.cos(angle_rad)), yaw_rad=angle_rad)
        drive.append(V2xStep(BEGIN_NS + index * STEP_NS, BEGIN_NS + (index + 1) * STEP_NS, (place,), ()))
    (sent,) = by_ghost(
        ghosts(SybilGrid(context("cam-sybil-grid"), ghosts=1, spacing_m=9.0, lane_m=5.0), drive)
    ).values()
    cams = [decoded(one) for one in sent][1:]
    for cam, report in cams:
        assert cam.speed_mps == pytest.approx(7.5, abs=0.02)
        assert cam.yaw_rate_radps == pytest.approx(0.5, abs=0.001)
        assert np.hypot(report.centre_m[0], report.centre_m[1] - 20) == pytest.approx(15, abs=0.03)
    for (_, before), (_, after) in pairwise(cams):
        moved_m = np.hypot(*np.subtract(after.centre_m[:2], before.centre_m[:2]))
        assert moved_m == pytest.approx(7.5 * (after.generation_ns - before.generation_ns) / 1e9, rel=0.01)


def test_no_ghost_vehicles_around_an_absent_vehicle():
    drive = lane({1: 0.0, 2: 50.0}, 30, leaves={2: 10})
    sent = ghosts(SybilGrid(context("cam-sybil-grid", victim=2), around="victim"), drive)
    assert max(time_s(one.request_ns) for one in sent) < 1.0
    with pytest.raises(AdvpipeError, match="around is 'victim', but no victim is given; name one"):
        SybilGrid(context("cam-sybil-grid"), around="victim")


def test_ghost_vehicles_share_the_radio_under_dcc():
    """60 ms between a radio's messages, ten ghost vehicles: none of them sends twice within 0.6 s."""
    found = by_ghost(ghosts(SybilGrid(context("cam-sybil-grid"), ghosts=10, dcc=True), DRIVE))
    assert min(np.diff([one.request_ns for one in messages]).min() for messages in found.values()) >= 6e8


def test_a_jam_ahead_of_the_victim():
    """Rears begin 5 + 2 * 10 m ahead of a front at 52.25 m, in rows of three and 7.5 m; they brake at 3 m/s2
    for 8.5 / 3 s and 16.29 m, and then crawl at 1.5 m/s."""
    attack = SybilCongestion(context("cam-sybil-congestion", victim=2), jitter_m=0, speed_spread=0)
    found = by_ghost(ghosts(attack, lane({1: 0.0, 2: 50.0}, 40)))
    assert len(found) == 6
    starts_m = set()
    for messages in found.values():
        for one in messages:
            cam, report = decoded(one)
            at_s = (report.generation_ns - BEGIN_NS) / 1e9
            braking_s = min(at_s, 8.5 / 3)
            way_m = 10 * braking_s - 1.5 * braking_s**2 + 1.5 * (at_s - braking_s)
            starts_m.add((round(report.front_m[0] - way_m, 1), round(report.front_m[1], 1) + 0.0))
            assert cam.speed_mps == pytest.approx(10 - 3 * braking_s, abs=0.011)
    rows_m = (52.25 + 25 + LENGTH_M, 52.25 + 25 + LENGTH_M + 7.5)
    assert {left_m for _, left_m in starts_m} == {0.0, 3.2, -3.2}
    assert {min(abs(start_m - row_m) for row_m in rows_m) < 0.06 for start_m, _ in starts_m} == {True}
    assert len({round((start_m - rows_m[0]) / 7.5) for start_m, _ in starts_m}) == 2


def test_random_offsets_in_a_jam_are_within_their_limits():
    attack = SybilCongestion(context("cam-sybil-congestion", victim=2), ghosts=30, jitter_m=2.0, lanes=1)
    found = by_ghost(ghosts(attack, lane({1: 0.0, 2: 50.0}, 40)))
    last = [decoded(messages[-1])[0].speed_mps for messages in found.values()]
    assert len(set(last)) > 5
    assert 1.42 <= min(last) <= max(last) <= 1.59


def test_a_jam_of_several_attackers_is_one():
    attack = SybilCongestion(context("cam-sybil-congestion", attackers=(1, 3), victim=2))
    sent = ghosts(attack, lane({1: 0.0, 2: 50.0, 3: 20.0}, 10))
    assert len(by_ghost(sent)) == 6
    senders = {
        one.station_id: set(by_ghost([o for o in sent if o.station_id == one.station_id])) for one in sent
    }
    assert {station: len(ids) for station, ids in senders.items()} == {1: 3, 3: 3}


def test_a_ghost_vehicle_follows_another_stations_track():
    """A ghost vehicle repeats station 2's messages a second and its own phase later, all by the same time."""
    sent = ghosts(SybilReplay(context("cam-sybil-replay"), age_s=1.0), DRIVE)
    theirs = [one for step in DRIVE for one in step.sent if one.station_id == 2]
    (shift_ns,) = {one.request_ns - old.request_ns for one, old in zip(sent, theirs, strict=False)}
    assert 10**9 < shift_ns < 11 * 10**8
    assert len(sent) in (19, 20)
    assert len(by_ghost(sent)) == 1
    for ghost, original in zip(sent, theirs, strict=False):
        (cam, report), (true_cam, true) = decoded(ghost), decoded(original)
        assert report.front_m == pytest.approx(true.front_m)
        assert report.generation_ns == true.generation_ns + round(shift_ns / 1e6) * 10**6
        assert cam.speed_mps == true_cam.speed_mps
        assert cam.station_id not in (1, 2)


@pytest.mark.parametrize("age_s", [0.5, 3.0])
def test_no_two_of_many_ghost_vehicles_send_at_once_nor_with_an_honest_station(age_s):
    """Multiples of the check interval are the case: three attackers replay the same four stations."""
    drive = lane({number: 20.0 * number for number in range(1, 8)}, 60)
    attack = SybilReplay(context("cam-sybil-replay", attackers=(1, 3, 5)), ghosts=4, age_s=age_s)
    added = ghosts(attack, drive)
    honest_ns = {one.request_ns for step in drive for one in step.sent}
    assert len(by_ghost(added)) == 12
    assert len({one.request_ns for one in added}) == len(added) > 250
    assert not honest_ns & {one.request_ns for one in added}


def test_each_followed_track_has_its_own_ghost_vehicle():
    drive = lane({1: 0.0, 2: 50.0, 3: 100.0, 4: 150.0}, 40)
    found = by_ghost(ghosts(SybilReplay(context("cam-sybil-replay"), ghosts=2, age_s=0.5), drive))
    assert len(found) == 2
    tracks = {
        round((decoded(one)[1].front_m[0] - 10 * time_s(one.request_ns)) / 50)
        for messages in found.values()
        for one in messages
    }
    assert len(tracks) == 2


def test_an_ended_track_is_replaced():
    """Station 2 leaves after 1 s: its ghost vehicle sends last before 2.02 s; another follows 2 s later."""
    drive = lane({1: 0.0, 2: 50.0}, 60, leaves={2: 10})
    late = lane({1: 0.0, 2: 50.0, 3: 100.0}, 60)
    drive = [
        step if index < 20 else step._replace(radios=late[index].radios[::2], sent=late[index].sent[::2])
        for index, step in enumerate(drive)
    ]
    found = by_ghost(ghosts(SybilReplay(context("cam-sybil-replay"), ghosts=1, age_s=1.0), drive))
    assert len(found) == 2
    first, second = found.values()
    assert 1.92 < time_s(first[-1].request_ns) < 2.02
    assert time_s(second[0].request_ns) > time_s(first[-1].request_ns) + 1.9


def test_same_seed_same_ghost_vehicles():
    first, again, other = (
        [one.payload for one in ghosts(SybilGrid(context("x", seed=seed), jitter_m=1.0), DRIVE)]
        for seed in (5, 5, 6)
    )
    assert first == again != other


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"ghosts": 0}, "ghosts is 0; it takes a number, 1 to 1000"),
        ({"width_m": 7}, "width_m is 7; it takes a number, 0.1 to 6"),
        ({"around": "me"}, "around is 'me'; known: attacker, victim"),
    ],
)
def test_bad_parameters(settings, message):
    with pytest.raises(AdvpipeError, match=message):
        SybilGrid(context("cam-sybil-grid"), **settings)
