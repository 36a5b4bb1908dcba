"""NextGen's numbers, as `attackGenerator.py` has them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from published_attacks import ADDED, MANY, claims, presets, published
from v2x_lane import decoded, edited, lane, time_s

from advpipe.stages.attack.v2x.published.nextgen_claims import carriageway

DRIVE = lane({1: 0.0, 2: 50.0, 3: -80.0}, 40)
FLEET = lane({number: 5.0 * number for number in MANY}, 3)
FRONT_M = 2.25


def test_every_row_of_the_catalogue_has_a_preset():
    found = presets("nextgen")
    assert len(found) == 15
    as_ours = {"cam-position-offset", "cam-position-random-offset"}
    assert {name for name, one in found.items() if not one.remark} == as_ours


@pytest.mark.parametrize(
    ("name", "distinct"), [("cam-position-offset", 1), ("cam-position-random-offset", 40)]
)
def test_offsets_of_20_to_70_m_along_both_axes(name, distinct):
    moved_m = set()
    for station_id in (1, 2):
        attack = published(name, "nextgen", attackers=(station_id,))
        for index, (_, report) in enumerate(claims(attack, DRIVE, station_id)):
            start_m = FRONT_M + 50.0 * (station_id - 1) + index
            moved_m.add(tuple(round(each, 1) for each in (report.front_m[0] - start_m, report.front_m[1])))
    assert len(moved_m) >= 2 * distinct
    assert all(19.9 <= abs(offset_m) <= 70.1 for place_m in moved_m for offset_m in place_m)


@pytest.mark.parametrize("name", ["cam-speed-offset", "cam-speed-random-offset"])
def test_speed_offsets_of_1_to_7(name):
    sent = edited(published(name, "nextgen", attackers=MANY), FLEET)
    offsets_mps = np.abs([decoded(one)[0].speed_mps - 10 for one in sent])
    assert 0.98 <= offsets_mps.min() < 1.6
    assert 6.4 < offsets_mps.max() <= 7.02


def test_zero_speed_frozen_speed_reversed_heading_and_multiplied_acceleration():
    for cam, _ in claims(published("cam-speed-constant", "nextgen"), DRIVE):
        assert cam.speed_mps == 0
    for _, report in claims(published("cam-heading-reversed", "nextgen"), DRIVE):
        assert abs(report.yaw_rad) == pytest.approx(math.pi, abs=0.002)
    drive = lane({number: 5.0 * number for number in MANY}, 2, accelerations_mps2=dict.fromkeys(MANY, 1.0))
    sent = edited(published("cam-acceleration", "nextgen", attackers=MANY), drive)
    factors = [decoded(one)[0].longitudinal_acceleration_mps2 for one in sent]
    assert (1.9 <= min(factors) < 2.3, 3.7 < max(factors) <= 4.1) == (True, True)
    frozen = published("cam-speed-frozen", "nextgen")
    assert frozen._probability == 0.05


def test_braking_is_feigned_only_while_accelerating():
    """1 m/s² becomes -2 to -4; deceleration and the pedals stay as they are."""
    own = dict.fromkeys(MANY, 1.0) | {40: -1.0}
    drive = lane({number: 5.0 * number for number in MANY}, 1, accelerations_mps2=own)
    sent = edited(published("cam-feigned-braking", "nextgen", attackers=MANY), drive)
    found = {one.station_id: decoded(one)[0] for one in sent}
    true = {one.station_id: decoded(one)[0] for one in drive[0].sent}
    assert found.pop(40) == true[40]
    claimed = [cam.longitudinal_acceleration_mps2 for cam in found.values()]
    assert -4.1 <= min(claimed) < -3.7
    assert -2.3 < max(claimed) <= -1.9
    assert all(cam.acceleration_control == true[one].acceleration_control for one, cam in found.items())


def test_the_position_is_mirrored_by_the_carriageway(road):
    """From y = 0 the lanes end at 4.5 m, and half of two lanes of 3.2 m is 3.2 m: 7.7 m to the left."""
    assert carriageway(road, (50.0, 0.0), 0.0) == (pytest.approx(4.5), 2)
    assert carriageway(road, (50.0, 0.5), 0.1)[0] == pytest.approx(4.0, abs=0.05)
    assert carriageway(road, (50.0, 9.0), math.pi) == (pytest.approx(4.5), 2)
    assert carriageway(road, (50.0, 50.0), 0.0)[1] == 0
    for index, (_, report) in enumerate(
        claims(published("cam-position-mirrored", "nextgen", roads=road), DRIVE)
    ):
        assert report.front_m[:2] == pytest.approx([FRONT_M + index, 7.7], abs=0.03)


def test_a_delay_moves_the_sending_time():
    """The generation time is as old as that of an honest message, and the place 2 to 4 s old."""
    drive = lane({1: 0.0, 2: 50.0}, 90)
    delays_s = []
    for attacker in (1, 2):
        attack = published("cam-delay", "nextgen", attackers=(attacker,))
        for one in edited(attack, drive):
            if one.station_id == attacker:
                _, report = decoded(one)
                start_m = FRONT_M + 50.0 * (attacker - 1)
                assert (one.request_ns - report.generation_ns) / 1e9 == pytest.approx(
                    0.01 * attacker, abs=0.001
                )
                delays_s.append(time_s(report.generation_ns) - (report.front_m[0] - start_m) / 10)
    assert min(delays_s) >= 2.0
    assert max(delays_s) <= 4.01
    assert len({round(delay_s, 2) for delay_s in delays_s}) <= 4


def test_two_to_four_identical_copies_within_half_a_second():
    fleet = lane({number: 5.0 * number for number in range(1, 13)}, 20)
    attack = published("cam-dos", "nextgen", attackers=range(1, 13))
    assert set(attack.multiples.values()) == {2, 3, 4}
    sent = edited(attack, fleet)
    genuine = {one.number for step in fleet for one in step.sent}
    assert not [one for one in sent if one.number in genuine]  # originals count as attack, too
    for attacker, multiple in attack.multiples.items():
        own = [decoded(one) for one in sent if one.station_id == attacker]
        by_place = {}
        for _, report in own:
            moved = round(report.front_m[0] - FRONT_M - 5.0 * attacker)
            by_place.setdefault(moved, []).append(time_s(report.generation_ns))
        for index in range(10):
            times_s = sorted(by_place[index])
            assert len(times_s) == multiple
            assert np.diff(times_s) == pytest.approx(0.5 / multiple, abs=0.0015)


def test_congestion_is_four_to_six_new_vehicles_around_the_attacker():
    counts = set()
    fleet = lane({number: 500.0 * number for number in range(1, 13)}, 4)
    attack = published("cam-sybil-congestion", "nextgen", attackers=range(1, 13), first_copy=0)
    sent = edited(attack, fleet)
    ids = [decoded(one)[0].station_id for one in sent if one.number >= ADDED]
    assert len(set(ids)) == len(ids)
    assert [one for one in sent if one.number < ADDED] == [one for step in fleet for one in step.sent]
    for own in (one for step in fleet for one in step.sent):
        near = [
            one
            for one in sent
            if one.number >= ADDED
            and one.station_id == own.station_id
            and 0 <= one.request_ns - own.request_ns <= 5 * 100_000
        ]
        counts.add(len(near))
        true = decoded(own)[1]
        for index, one in enumerate(near):
            cam, report = decoded(one)
            assert 9.5 - 0.01 <= cam.speed_mps <= 10.51
            # A heading of 90 degrees, taken from the x axis: rows lie along y, sides along x.
            side_m, row_m = (abs(a - b) for a, b in zip(report.front_m[:2], true.front_m[:2], strict=True))
            rows = math.ceil(index / 2)
            assert 0 <= side_m <= 3 + 2 + 0.02
            assert 5 * rows - 2.02 <= row_m <= 6 * rows + 2.02
            assert abs(report.yaw_rad) <= math.radians(0.95)
    assert counts == {4, 5, 6}


def test_ghost_vehicles_come_two_to_200_seconds_late():
    """The spacing of 1 to 100 µs is multiplied by a message number from 2 000 000 on."""
    spacings_ns = [*published("cam-sybil-congestion", "nextgen", attackers=MANY)._spacings_ns.values()]
    assert (1000 <= min(spacings_ns) < 15_000, 85_000 < max(spacings_ns) <= 100_000) == (True, True)
    seeds = (published("cam-sybil-congestion", "nextgen", seed=seed) for seed in range(200))
    attack = next(one for one in seeds if one._spacings_ns[1] < 2000)
    drive = lane({1: 0.0}, 60)
    first = next(one for one in edited(attack, drive) if one.number >= ADDED)
    late_s = time_s(first.request_ns) - 0.01
    assert late_s == pytest.approx(attack._spacings_ns[1] * 2e6 / 1e9)
    assert decoded(first)[1].front_m[0] == pytest.approx(FRONT_M, abs=5.1)


def test_it_stops_at_the_message_of_the_draw():
    drive = lane({1: 0.0}, 100, accelerations_mps2={1: 1.0})
    found = claims(published("cam-sudden-stop", "nextgen"), drive)
    stopped = [cam.speed_mps == 0 for cam, _ in found]
    first = stopped.index(True)
    assert stopped == [False] * first + [True] * (100 - first)
    for cam, report in found[first:]:
        assert report.front_m[0] == pytest.approx(FRONT_M + first, abs=0.02)
        assert cam.longitudinal_acceleration_mps2 == 0


def test_a_replay_begins_with_the_oldest_message_of_the_last_five_seconds():
    """Of station 2 alone: one, four to eight more, and then none, as the next victim has to be another."""
    drive = lane({1: 0.0, 2: 50.0}, 100)
    active = decoded(drive[80].sent[0])[1].generation_ns
    attack = published("cam-replay", "nextgen", active=lambda time_ns: time_ns >= active)
    assert 4 <= attack._lengths[1] <= 8
    found = claims(attack, drive)[80:]
    length = 1 + attack._lengths[1]
    for index, (cam, report) in enumerate(found):
        is_replayed = index < length
        start_m = 52.25 + 30 + index if is_replayed else FRONT_M + 80 + index
        assert report.front_m[0] == pytest.approx(start_m, abs=1.02 if is_replayed else 0.02)
        assert cam.station_id == 1
        if index >= length:
            break


def test_a_replay_of_nobody_within_400_m_changes_nothing():
    drive = lane({1: 0.0, 2: 500.0}, 40)
    assert edited(published("cam-replay", "nextgen"), drive) == [one for step in drive for one in step.sent]
